"""One task on a Dask worker, which may be on another machine.

A worker is a process. It runs one task at a time even where it has several threads: many libraries
that tasks use keep state for the whole process.
"""

from __future__ import annotations

import errno
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brrp_cli.errors import BrrpError, ClusterError, unexpected
from brrp_cli.executors.processes import ONE_THREAD
from brrp_cli.version import __version__

_AT_WORK = threading.Lock()
# What another machine may well do better: its disk, memory or number of files is no property of
# the task.
_OF_THE_MACHINE = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EIO,
    errno.EROFS,
    errno.ENOMEM,
    errno.EMFILE,
    errno.ENFILE,
    errno.ESTALE,
}


@dataclass(frozen=True)
class Job:
    """What all tasks of a run have in common.

    time_limit : seconds; folder : what relative paths are relative to; seen : absolute paths that
    must be there; version : the client's brrp
    """

    function: Callable[..., Any]
    time_limit: float
    folder: Path
    seen: tuple[Path, ...]
    version: str = __version__


@dataclass(frozen=True)
class MachineFault:
    """A task failed for the machine's sake: another worker may do it. worker : its address"""

    error: BrrpError
    worker: str


def work(job: Job, task: tuple[Any, ...]) -> Any:
    """In the worker: the result, the error as a BrrpError, a MachineFault, or a ClusterError where
    this worker can do no task of the job."""
    with _AT_WORK:
        refusal = _refusal(job)
        if refusal is not None:
            return refusal
        try:
            with _dies_after(job.time_limit), chdir(job.folder), _one_thread():
                return job.function(*task)
        except Exception as error:
            told = error if isinstance(error, BrrpError) else unexpected(error)
            if _of_the_machine(error):
                from distributed import get_worker

                return MachineFault(told, get_worker().address)
            return told


def _refusal(job: Job) -> ClusterError | None:
    """Why this worker cannot do tasks of the job."""
    if job.version != __version__:
        return ClusterError(
            "A worker has another version of brrp",
            where=socket.gethostname(),
            expected=job.version,
            found=__version__,
            fix="install the same version on all machines",
        )
    missing = next((path for path in (job.folder, *job.seen) if not path.exists()), None)
    if missing is None:
        return None
    return ClusterError(
        "A worker does not see what this process sees",
        where=f"{missing}, on {socket.gethostname()}",
        expected="a folder that all machines share, under the same path on each",
        fix="put meshes, scenes, prior and output into the shared folder, and run the command "
        "there",
    )


@contextmanager
def _dies_after(seconds: float) -> Iterator[None]:
    """End the process if it is still in here then. The kernel does it, also where a library holds
    the interpreter's lock; Dask gives the task to another worker, and the nanny starts a new one.
    """
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Libraries that are loaded already are held to one thread; those to come read the
    environment. More threads would change the last bits of results."""
    from threadpoolctl import threadpool_limits

    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    with threadpool_limits(1):
        yield


def _of_the_machine(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        if isinstance(error, OSError) and error.errno in _OF_THE_MACHINE:
            return True
        error = error.__cause__ or error.__context__
    return False
