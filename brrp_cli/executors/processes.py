"""Run one function on many tasks in processes of their own, whatever becomes of any of them.

`concurrent.futures` gives up all tasks when one worker dies. In Pebble's pool a task that kills its
worker or takes too long fails alone, and another worker takes the place.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, TimeoutError, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.util import is_exiting
from pathlib import Path
from typing import Any

from brrp_cli.errors import BrrpError, unexpected
from brrp_cli.spoken import counted

# Seconds that a worker which is to stop may take to end by itself.
PATIENCE = 5.0
# Seconds without a task at work after which it is asked whether processes start at all, and what
# one that does nothing may take.
_START, _PROBE = 10.0, 60.0
# How processes start, in the words of `multiprocessing`: afresh, for no thread survives a fork.
START = "spawn"
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Processes:
    """An executor of so many processes on this machine."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self.title = counted(workers, "worker")

    def run(
        self,
        function: Callable[..., Any],
        tasks: Sequence[tuple[Any, ...]],
        time_limit: float,
        *,
        reads: Sequence[Path] = (),
        writes: Path | None = None,
    ) -> Generator[tuple[int, Any], None, None]:
        """As `Executor.run`. No more than `workers` tasks are out at a time."""
        if not tasks:
            return
        try:
            yield from _results(function, tasks, min(self.workers, len(tasks)), time_limit)
        except OSError as error:
            # The system's own words for no more processes, or for no semaphores. A
            # BrokenPipeError, of a helper of multiprocessing that died, would end a command
            # without a word.
            raise cannot_start(error) from error


def _results(
    function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]], workers: int, time_limit: float
) -> Generator[tuple[int, Any], None, None]:
    import pebble

    pebble.CONSTS.term_timeout = PATIENCE
    todo = list(enumerate(tasks))[::-1]
    running: dict[Future[Any], int] = {}
    pool = _pool(workers)
    with _one_thread():
        try:
            while todo or running:
                if not pool.active:
                    # A worker died that held no task: Pebble gives up the pool.
                    _stop(pool)
                    pool = _pool(workers)
                while todo and len(running) < workers:
                    index, task = todo.pop()
                    future = pool.schedule(_call, (function, task), timeout=time_limit)
                    running[future] = index
                ended = wait(running, timeout=_START, return_when=FIRST_COMPLETED).done
                broken = any(isinstance(future.exception(), BrokenProcessPool) for future in ended)
                if broken or not (ended or any(future.running() for future in running)):
                    require_processes()
                for future in ended:
                    yield running.pop(future), _result(future, time_limit)
        finally:
            _stop(pool)


def require_processes() -> None:
    """BrrpError unless a process that does nothing starts and ends well."""
    context: Any = multiprocessing.get_context(START)
    process = context.Process(target=_nothing)
    try:
        process.start()
    except OSError as error:
        raise cannot_start(error) from error
    process.join(_PROBE)
    if process.exitcode is None:
        process.kill()
        process.join()
        raise cannot_start(f"one that does nothing did not end in {_PROBE:g} s")
    if process.exitcode != 0:
        raise cannot_start(f"one that does nothing ended with exit code {process.exitcode}")


def _nothing() -> None:
    """What a process does that is only there to see whether it starts."""


def cannot_start(found: object) -> BrrpError:
    """The message where worker processes do not start."""
    return BrrpError(
        "Worker processes cannot start",
        expected="processes beside this one, and semaphores for them in /dev/shm",
        found=found,
        fix="lift the limit on processes (ulimit -u) or what the container forbids; a script of"
        ' your own must start its work below `if __name__ == "__main__":`',
    )


def _pool(workers: int) -> Any:
    import pebble

    context = multiprocessing.get_context(START)
    return pebble.ProcessPool(workers, initializer=_end_once, context=context)


def _end_once() -> None:
    """In the worker: once it ends, no signal to end cuts that short.

    Pebble closes a worker's pipe, at which it ends by itself, and sends SIGTERM at the same time.
    What is cut short leaves its named semaphores (tqdm makes one) for Python to complain of.
    """
    end: Any = signal.getsignal(signal.SIGTERM)

    def end_unless_ending(number: int, where: Any) -> None:
        if not is_exiting():
            end(number, where)

    signal.signal(signal.SIGTERM, end_unless_ending)


def _stop(pool: Any) -> None:
    pool.stop()
    pool.join()


def _call(function: Callable[..., Any], task: tuple[Any, ...]) -> Any:
    """In the worker: the result, or the error as a BrrpError."""
    try:
        return function(*task)
    except BrrpError as error:
        return error
    except Exception as error:
        return unexpected(error)


def _result(future: Future[Any], time_limit: float) -> Any:
    from pebble import ProcessExpired

    try:
        return future.result()
    except TimeoutError:
        return BrrpError("Took too long", expected=f"at most {time_limit:g} s")
    except ProcessExpired as error:
        code = error.exitcode
        died = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return BrrpError("The worker process died", found=died)
    except BrokenProcessPool as error:
        return BrrpError("The worker process died", found=error)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Numerical libraries read these variables when they are loaded, in the new process."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
