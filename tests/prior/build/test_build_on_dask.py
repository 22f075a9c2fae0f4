"""The same prior from a Dask cluster, whatever becomes of its workers."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
import trimesh
from click.testing import CliRunner
from small_prior import prior_bytes
from test_build_faults import TINY

from brrp_cli.cli import main
from brrp_cli.errors import ClusterError
from brrp_cli.executors import cluster
from brrp_cli.executors.cluster import Cluster
from brrp_cli.prior.build.build import build_prior

NAMES = ["ad", "ae", "af", "ah", "aj"]


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("boxes")
    for i, name in enumerate(NAMES):
        trimesh.creation.box((0.05 + 0.01 * i, 0.04, 0.03)).export(folder / f"{name}.ply")
    (folder / "bad.obj").write_text("v 0 0 0\n")
    return folder


@pytest.fixture(scope="module")
def wanted(boxes: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("wanted")
    build_prior(boxes, out, TINY, workers=1)
    return prior_bytes(out)


def another(killed: list[int]) -> int:
    """The process of a worker that was not killed yet: the next one may still be starting."""
    until = time.monotonic() + 30
    while time.monotonic() < until:
        for worker in multiprocessing.active_children():
            if worker.pid and worker.pid not in killed:
                return worker.pid
        time.sleep(0.02)
    raise AssertionError("no worker took the place of the one that was killed")


def test_a_cluster_makes_the_same_bytes_while_its_workers_are_killed(
    boxes: Path,
    wanted: dict[str, bytes],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    run, killed = Cluster.run, list[int]()

    def murderous(self: Cluster, *given: Any, **named: Any) -> Generator[Any, None, None]:
        for number, result in enumerate(run(self, *given, **named)):
            yield result
            if number < 2:
                # It holds the next task, or one of those that are to come.
                worker = another(killed)
                os.kill(worker, signal.SIGKILL)
                killed.append(worker)

    monkeypatch.setattr(Cluster, "run", murderous)
    # Dask gives both up before they can be back: others must take their places.
    monkeypatch.setattr(cluster, "RESTART", "0.1s")
    # One may have died with its result.
    monkeypatch.setattr(cluster, "FETCH", 1.0)
    report = build_prior(boxes, tmp_path / "prior", TINY, scheduler="local:2")
    assert len(set(killed)) == 2
    assert report.made == NAMES and [failure.name for failure in report.manifest.failed] == ["bad"]
    assert prior_bytes(tmp_path / "prior") == wanted
    assert not multiprocessing.active_children()
    assert "distributed" not in capfd.readouterr().err


@pytest.mark.slow
def test_what_was_finished_when_the_cluster_was_lost_is_kept(
    boxes: Path, wanted: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = Cluster.run

    def lost(self: Cluster, *given: Any, **named: Any) -> Generator[Any, None, None]:
        results = run(self, *given, **named)
        yield next(results)
        self.client.cluster.close()
        yield from results

    with monkeypatch.context() as patch:
        patch.setattr(Cluster, "run", lost)
        with pytest.raises(ClusterError, match="The Dask scheduler is gone"):
            build_prior(boxes, tmp_path / "prior", TINY, scheduler="local:1")
    report = build_prior(boxes, tmp_path / "prior", TINY, workers=1)
    assert len(report.kept) == 1
    assert prior_bytes(tmp_path / "prior") == wanted


def test_the_command_tells_in_one_message_that_nobody_answers(
    boxes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECT", 0.5)
    given = ["build-prior", str(boxes), "-o", str(tmp_path / "prior")]
    result = CliRunner().invoke(main, [*given, "--scheduler", "tcp://nowhere.invalid:8786"])
    assert result.exit_code == 1
    assert "Error: No Dask scheduler answers" in result.output
    assert "Traceback" not in result.output
