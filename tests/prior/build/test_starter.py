"""The starter prior and what it is made from."""

import json

import numpy as np
import pytest
import trimesh

from brrp_cli.prior.build.starter import starter_prior, write_shapes
from brrp_cli.prior.default import locate_prior
from brrp_cli.prior.store import open_prior, verify_prior
from brrp_cli.shapes.household import household_shapes


def test_shapes_come_back_from_their_files_closed_and_in_metres(tmp_path):
    phrases = json.loads(write_shapes(tmp_path).read_text())
    shapes = household_shapes()
    assert set(phrases) == {shape.name for shape in shapes}
    for shape in shapes:
        mesh = trimesh.load(tmp_path / f"{shape.name}.ply")
        assert mesh.is_watertight
        np.testing.assert_allclose(mesh.bounds, shape.mesh.bounds, atol=1e-6)
        assert phrases[shape.name] == shape.description


def test_files_are_the_same_each_time(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_shapes(tmp_path / name)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_the_prior_is_built_once_and_holds_the_shapes_in_their_real_sizes(two_shapes):
    path = starter_prior(workers=1)
    prior = open_prior(path)
    assert verify_prior(prior) == []
    assert prior.names == ["soup_can", "wood_block"]
    for shape in two_shapes:
        stored = prior.load(shape.name)
        assert stored.description == shape.description
        assert stored.half_extent == pytest.approx(shape.mesh.extents.max() / 2, rel=1e-4)
    before = {p: p.stat().st_mtime_ns for p in path.rglob("*") if p.is_file()}
    assert starter_prior(workers=1) == path
    assert {p: p.stat().st_mtime_ns for p in path.rglob("*") if p.is_file()} == before


def test_a_prior_cut_short_or_of_other_parameters_is_built_again(two_shapes):
    path = starter_prior(workers=1)
    whole = (path / "manifest.json").read_bytes()
    (path / "manifest.json").write_bytes(whole[: len(whole) // 2])
    assert (starter_prior(workers=1) / "manifest.json").read_bytes() == whole
    table = json.loads(whole)
    table["parameters"]["samples"] = 7
    (path / "manifest.json").write_text(json.dumps(table))
    assert (starter_prior(workers=1) / "manifest.json").read_bytes() == whole


def test_commands_find_it_where_there_is_no_other_prior(two_shapes):
    assert locate_prior(None) == (starter_prior(), "the starter prior")
