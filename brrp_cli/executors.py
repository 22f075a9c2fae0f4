"""Run one function on many tasks in processes of their own, whatever becomes of any of them.

`concurrent.futures` gives up all tasks when one worker dies. Here a worker that dies or takes too
long costs its task alone.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from brrp_cli.errors import BrrpError, unexpected

_CONTEXT = multiprocessing.get_context("spawn")
# Seconds that a worker with nothing to do may take to end.
PATIENCE = 10.0
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass
class _Worker:
    process: Any
    pipe: Connection
    index: int | None = None
    deadline: float = 0.0

    def stop(self) -> None:
        if self.index is None:
            # It ends by itself at the end of its pipe, and gives back what it holds: the named
            # semaphores of a killed process (tqdm makes one) are left for Python to complain of.
            self.pipe.close()
            self.process.join(PATIENCE)
        self.process.kill()
        self.process.join()
        self.pipe.close()


def run_tasks(
    function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]], workers: int, time_limit: float
) -> Generator[tuple[int, Any], None, None]:
    """Yield (index, result) as tasks end; a failed task's result is the exception.

    function : importable by name; called with each task's values in a process with one thread.
    time_limit : seconds for one task. Each worker holds one task at a time, so that results that
    nobody has taken yet do not pile up.
    """
    todo = list(range(len(tasks)))[::-1]
    crew: list[_Worker] = []
    try:
        while todo or any(worker.index is not None for worker in crew):
            while todo and len(crew) < workers:
                crew.append(_hire(function))
            for worker in crew:
                if worker.index is None and todo:
                    worker.index = todo.pop()
                    worker.deadline = time.monotonic() + time_limit
                    worker.pipe.send(tasks[worker.index])
            busy = [worker for worker in crew if worker.index is not None]
            patience = max(0.0, min(worker.deadline for worker in busy) - time.monotonic())
            wait([worker.pipe for worker in busy], patience)
            for worker in busy:
                answer = _answer(worker, time_limit)
                if answer is None:
                    continue
                index, worker.index = worker.index, None
                if not worker.process.is_alive():
                    worker.stop()
                    crew.remove(worker)
                assert index is not None
                yield index, answer[0]
    finally:
        for worker in crew:
            worker.stop()


def _answer(worker: _Worker, time_limit: float) -> tuple[Any] | None:
    """What the worker has to say, in a tuple; None while it is at work."""
    if worker.pipe.poll():
        try:
            return (worker.pipe.recv(),)
        except (EOFError, ConnectionError):
            worker.process.join()
            code = worker.process.exitcode
            died = signal.Signals(-code).name if code and code < 0 else f"exit code {code}"
            return (BrrpError("The worker process died", found=died),)
    if time.monotonic() >= worker.deadline:
        worker.process.kill()
        worker.process.join()
        return (BrrpError("Took too long", expected=f"at most {time_limit:g} s"),)
    return None


def _hire(function: Callable[..., Any]) -> _Worker:
    ours, theirs = _CONTEXT.Pipe()
    process = _CONTEXT.Process(target=_serve, args=(theirs, function), daemon=True)
    with _one_thread():
        process.start()
    theirs.close()
    return _Worker(process, ours)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Numerical libraries read these variables when they are loaded, in the new process."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(pipe: Connection, function: Callable[..., Any]) -> None:
    # Ctrl-C reaches the whole group; the parent alone decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        try:
            result = function(*task)
        except BrrpError as error:
            result = error
        except Exception as error:
            result = unexpected(error)
        try:
            pipe.send(result)
        except ConnectionError:
            # Whoever asked is gone.
            return
