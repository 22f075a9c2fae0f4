import multiprocessing
import os
import signal
import time
from multiprocessing.util import Finalize
from pathlib import Path

from brrp_cli.errors import BrrpError, MeshError
from brrp_cli.executors import run_tasks


def act(what: str) -> str:
    if what == "refuse":
        raise MeshError("Not this one", found="a hole")
    if what == "stumble":
        raise ZeroDivisionError("by zero")
    if what == "die":
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "hang":
        time.sleep(600)
    if what == "threads":
        return os.environ["OMP_NUM_THREADS"]
    return what.upper()


def test_each_task_ends_alone_whatever_becomes_of_it() -> None:
    tasks = [(what,) for what in ("a", "die", "refuse", "b", "hang", "stumble", "threads", "c")]
    results = dict(run_tasks(act, tasks, workers=2, time_limit=5.0))
    assert sorted(results) == list(range(8))
    assert [results[i] for i in (0, 3, 6, 7)] == ["A", "B", "1", "C"]
    assert "SIGSEGV" in str(results[1])
    assert isinstance(results[2], MeshError)
    assert results[2].found == "a hole"
    assert results[4].what == "Took too long"
    assert isinstance(results[5], BrrpError)
    assert "ZeroDivisionError" in str(results[5])


def promise(path: Path) -> None:
    """What a process does when it ends by itself, as locks between processes do to be removed."""
    Finalize(None, path.touch, exitpriority=0)


def test_workers_with_nothing_to_do_end_by_themselves(tmp_path: Path) -> None:
    paths = [tmp_path / "a", tmp_path / "b"]
    assert len(list(run_tasks(promise, [(path,) for path in paths], 2, 60.0))) == 2
    assert all(path.exists() for path in paths)


def test_closing_early_leaves_no_process() -> None:
    before = dict(os.environ)
    results = run_tasks(act, [("a",), ("hang",)], workers=2, time_limit=60.0)
    assert next(results) == (0, "A")
    assert multiprocessing.active_children()
    results.close()
    assert not multiprocessing.active_children()
    assert dict(os.environ) == before


def test_a_worker_that_is_killed_while_it_has_nothing_to_do_costs_no_task() -> None:
    results = run_tasks(act, [("a",), ("b",), ("c",)], workers=1, time_limit=60.0)
    assert next(results) == (0, "A")
    for child in multiprocessing.active_children():
        child.kill()
        child.join()
    time.sleep(0.5)
    assert list(results) == [(1, "B"), (2, "C")]
