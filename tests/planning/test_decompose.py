"""Meshes decomposed in processes of their own: the same parts, and what happens when one dies."""

from __future__ import annotations

import time

import numpy as np
import pytest

from brrp_cli.config.planning import PartsConfig
from brrp_cli.errors import ResultError
from brrp_cli.planning import decompose
from brrp_cli.planning.decompose import NamedMesh, parts_of
from brrp_cli.planning.parts import COACD, HULL, convex_parts
from brrp_cli.shapes import solids

CONFIG = PartsConfig()


def solid(mesh, name="one") -> NamedMesh:
    return NamedMesh(name, np.asarray(mesh.vertices), np.asarray(mesh.faces))


@pytest.fixture
def two():
    channel = solids.difference(
        solids.box(0.12, 0.08, 0.08), solids.moved(solids.box(0.06, 0.1, 0.08), z=0.03)
    )
    return [solid(channel, "channel"), solid(solids.box(0.1, 0.06, 0.04), "box")]


@pytest.mark.parametrize("how", [COACD, HULL])
def test_parts_are_those_of_one_process(how, two):
    pytest.importorskip("coacd")
    for found, each in zip(parts_of(two, how, 0, CONFIG), two, strict=True):
        expected = convex_parts(each.vertices, each.faces, how, 0, CONFIG)
        assert len(found) == len(expected)
        assert all(np.array_equal(a, b) for a, b in zip(found, expected, strict=True))


def test_a_process_that_dies_takes_nothing_along(two, monkeypatch):
    monkeypatch.setattr(decompose, "_BEGIN", "raise SystemExit('too much memory')")
    with pytest.raises(ResultError, match=r"(?s)died over a mesh.*channel.*too much.*hull"):
        list(parts_of(two, COACD, 0, CONFIG))


def test_who_stops_waits_for_none(two, monkeypatch):
    begin = "import time; print('', flush=True); time.sleep(600)"
    monkeypatch.setattr(decompose, "_BEGIN", begin)
    running = decompose._Running()
    monkeypatch.setattr(decompose, "_Running", lambda: running)

    def stop(process, task):
        raise KeyboardInterrupt

    monkeypatch.setattr(decompose.subprocess.Popen, "communicate", stop)
    with pytest.raises(KeyboardInterrupt):
        next(parts_of(two[:1], COACD, 0, CONFIG))
    (process,) = running.processes
    start = time.perf_counter()
    assert process.wait(timeout=60) < 0
    assert time.perf_counter() - start < 60


def test_no_solid_has_no_parts():
    assert list(parts_of([], COACD, 0, CONFIG)) == []
