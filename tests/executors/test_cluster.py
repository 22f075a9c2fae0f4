"""Tasks on a real Dask cluster of two workers: what becomes of tasks, workers and the cluster."""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import dask
import pytest
from distributed import LocalCluster

from brrp_cli.errors import BrrpError, ClusterError, DependencyError, MeshError
from brrp_cli.executors import cluster
from brrp_cli.executors.executor import open_executor


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Two workers; a task may cost one worker its life."""
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        # On a busy machine a worker takes long to come back.
        dask.config.set({"distributed.deploy.lost-worker-timeout": "120s"}),
        LocalCluster(2, threads_per_worker=1, dashboard_address=":0", silence_logs=60) as started,
    ):
        yield started.scheduler_address


def act(what: str, folder: Path) -> Any:
    mark = folder / what
    first = not mark.exists()
    mark.touch()
    if what == "refuse":
        raise MeshError("Not this one", found="a hole")
    if what == "stumble":
        raise ZeroDivisionError("by zero")
    if what == "die" or (what == "die once" and first):
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "hang once" and first:
        time.sleep(600)
    if what == "disk full once" and first:
        mark.write_text(str(os.getpid()))
        raise MeshError("Cannot write") from OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    if what == "disk full once":
        return int(mark.read_text()), os.getpid()
    if what == "disk full":
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    if what == "surroundings":
        return os.environ["OMP_NUM_THREADS"], Path.cwd()
    return what.upper()


def test_a_worker_that_dies_with_its_result_is_replaced_and_the_task_is_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the news of its end and its result."""
    ended, killed = cluster._ended, []

    def then_killed(running: dict[Any, int]) -> list[Any]:
        found = ended(running)
        if found and not killed:
            worker = multiprocessing.active_children()[0]
            worker.kill()
            worker.join()
            killed.append(worker)
        return found

    monkeypatch.setattr(cluster, "_ended", then_killed)
    monkeypatch.setattr(cluster, "RESTART", "0.1s")
    monkeypatch.setattr(cluster, "FETCH", 1.0)
    with open_executor(scheduler="local:1") as executor:
        assert dict(executor.run(act, [("a", tmp_path)], 60.0)) == {0: "A"}
    assert killed


def test_each_task_ends_alone_whatever_becomes_of_workers(address: str, tmp_path: Path) -> None:
    names = ["a", "refuse", "stumble", "surroundings", "disk full once", "disk full", "b"]
    fatal = ["hang once", "die once", "die"]
    with open_executor(scheduler=address) as executor:
        results = dict(executor.run(act, [(n, tmp_path) for n in names], 60.0, reads=[tmp_path]))
        # One after the other: the death of a worker counts against all tasks that it holds.
        rest = [dict(executor.run(act, [(name, tmp_path)], 3.0))[0] for name in fatal]
    assert sorted(results) == list(range(len(names)))
    assert (results[0], results[6]) == ("A", "B")
    assert isinstance(results[1], MeshError) and results[1].found == "a hole"
    assert "ZeroDivisionError" in str(results[2])
    assert results[3] == ("1", Path.cwd())
    before, after = results[4]
    assert before != after, "the other worker is to do what a full disk refused"
    assert isinstance(results[5], BrrpError) and "No space left" in str(results[5])
    assert rest[:2] == ["HANG ONCE", "DIE ONCE"]
    assert rest[2].what == "The worker process died" and "2 workers" in rest[2].found


def test_the_death_of_a_worker_is_not_held_against_what_waits_for_it(
    address: str, tmp_path: Path
) -> None:
    """Two workers at most may die of a task here, and more than that die of the first one."""
    tasks = [("die", tmp_path), *((name, tmp_path) for name in "abcd")]
    with open_executor(scheduler=address) as executor:
        results = dict(executor.run(act, tasks, 60.0))
    assert results[0].what == "The worker process died"
    assert [results[i] for i in range(1, 5)] == ["A", "B", "C", "D"]


def slow(folder: Path) -> int:
    with (folder / "begun").open("a") as stream:
        stream.write(".")
    time.sleep(0.05)
    return (folder / "begun").stat().st_size


def test_no_more_is_out_than_workers_can_do_soon(address: str, tmp_path: Path) -> None:
    with open_executor(scheduler=address) as executor:
        for taken, (_, begun) in enumerate(executor.run(slow, [(tmp_path,)] * 12, 60.0)):
            # Of those that nobody has taken yet, one for each worker and a few more.
            assert begun <= taken + 2 + cluster.AHEAD
            time.sleep(0.1)


def test_what_workers_do_not_see_is_told(address: str, tmp_path: Path) -> None:
    with open_executor(scheduler=address) as executor:
        with pytest.raises(ClusterError, match="does not see") as told:
            list(executor.run(act, [("a", tmp_path)], 60.0, reads=[tmp_path / "elsewhere"]))
        assert str(tmp_path / "elsewhere") in str(told.value.where)
        assert dict(executor.run(act, [("a", tmp_path)], 60.0, writes=tmp_path)) == {0: "A"}
    assert not list(tmp_path.glob(".brrp-shared-*"))


def test_a_scheduler_file_serves_as_an_address(address: str, tmp_path: Path) -> None:
    file = tmp_path / "scheduler.json"
    file.write_text(f'{{"address": "{address}"}}')
    with open_executor(scheduler=str(file)) as executor:
        assert dict(executor.run(act, [("a", tmp_path)], 60.0)) == {0: "A"}
    file.write_text("{}")
    with pytest.raises(ClusterError, match="no scheduler file"), open_executor(scheduler=str(file)):
        pass


@pytest.mark.slow
def test_a_scheduler_that_goes_away_is_told(tmp_path: Path) -> None:
    with (
        LocalCluster(1, dashboard_address=":0", silence_logs=60) as started,
        open_executor(scheduler=started.scheduler_address) as executor,
    ):
        results = executor.run(act, [("hang once", tmp_path)], 60.0)
        threading.Timer(0.5, started.close).start()
        with pytest.raises(ClusterError, match="The Dask scheduler is gone"):
            next(results)


@pytest.mark.parametrize("wrong", ["tcp://127.0.0.1:9", "nonsense", "pigeon://post:1", "local:0"])
def test_a_scheduler_that_does_not_answer_is_told_soon(
    wrong: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECT", 0.5)
    start = time.monotonic()
    with (
        pytest.raises(ClusterError, match="No Dask scheduler answers") as told,
        open_executor(scheduler=wrong),
    ):
        pass
    assert told.value.where == wrong
    assert time.monotonic() - start < 5


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    wanted = r"pip install 'brrp-cli\[cluster\]'"
    with pytest.raises(DependencyError, match=wanted), open_executor(scheduler="local:1"):
        pass


def test_processes_and_a_cluster_exclude_each_other() -> None:
    with pytest.raises(BrrpError, match="exclude each other"), open_executor(2, "local:2"):
        pass
