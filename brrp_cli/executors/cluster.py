"""Tasks on a Dask cluster: its scheduler, workers anywhere that share a folder with this process.

Dask gives a task whose worker died to another one, a few times (`allowed-failures` of the
scheduler's configuration, 3 unless set). What it does not know of is here: which of the tasks that
a worker held it died of, time limits, faults of one machine, workers that lack the folder, and a
bound on what is out.
"""

from __future__ import annotations

import json
import logging
import math
import re
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from brrp_cli.errors import BrrpError, ClusterError, DependencyError
from brrp_cli.executors.cluster_task import Job, MachineFault, work
from brrp_cli.executors.processes import cannot_start
from brrp_cli.executors.shared_folder import token
from brrp_cli.progress import note
from brrp_cli.spoken import counted

# Tasks that are out beyond one for each worker thread, so that no worker waits for this process.
AHEAD = 2
# Further tries of a task that failed for its machine's sake; as Dask's own for workers that died.
RETRIES = 3
# How long a worker of a local cluster may take to start again before another takes its place.
RESTART = "60s"
# Seconds: until a scheduler must have answered, between looks at how many workers there are, until
# it is said that there are none, and for a result, which is small, to come from its worker.
CONNECT, LOOK, NO_WORKERS, FETCH = 10.0, 2.0, 20.0, 20.0
# In place of a result whose worker died before it could be had.
NOT_YET = object()


class _WorkersDiedError(BrrpError):
    """Of a task, or of another one that was with the same workers."""


_LOCAL = re.compile(r"local:([1-9]\d{0,3})")


@contextmanager
def open_cluster(scheduler: str) -> Iterator[Cluster]:
    """Connect to a scheduler by its address or its scheduler file (.json), or start N workers here
    for "local:N". Errors: DependencyError without Dask; ClusterError where nothing answers;
    BrrpError where no worker starts.
    """
    try:
        import distributed
    except ImportError as error:
        raise DependencyError(
            "--scheduler needs Dask",
            found=error,
            fix="pip install 'brrp-cli[cluster]', in the environment that runs brrp",
        ) from error
    with ExitStack() as stack:
        stack.enter_context(_quiet_logs())
        local = _LOCAL.fullmatch(scheduler)
        if local:
            client, revive = stack.enter_context(_local(int(local[1])))
            title = f"{counted(int(local[1]), 'Dask worker')} on this machine"
        else:
            # Elsewhere Dask's nannies, or what started the cluster, replace workers.
            revive = None
            address = _address(scheduler)
            try:
                client = distributed.Client(address, timeout=CONNECT)
            except (OSError, ValueError, TypeError, RuntimeError) as error:
                raise _no_answer(address, error) from error
            stack.callback(client.close, timeout=CONNECT)
            title = f"the Dask cluster {address}"
        yield Cluster(client, title, revive)


class Cluster:
    """An executor on the workers of a Dask client. revive : replaces workers that are gone, given
    how many there are"""

    def __init__(
        self, client: Any, title: str, revive: Callable[[int], None] | None = None
    ) -> None:
        self.client = client
        self.title = title
        self.revive = revive

    def run(
        self,
        function: Callable[..., Any],
        tasks: Sequence[tuple[Any, ...]],
        time_limit: float,
        *,
        reads: Sequence[Path] = (),
        writes: Path | None = None,
    ) -> Generator[tuple[int, Any], None, None]:
        """As `Executor.run`."""
        with token(writes) as tokens:
            seen = tuple(path.resolve() for path in (*reads, *tokens))
            job = Job(function, time_limit, Path.cwd(), seen)
            yield from self._results(job, tasks)

    def _results(
        self, job: Job, tasks: Sequence[tuple[Any, ...]]
    ) -> Generator[tuple[int, Any], None, None]:
        todo = deque(range(len(tasks)))
        # The death of a worker counts against all tasks that it holds: those are done again alone.
        suspects: deque[int] = deque()
        alone = False
        running: dict[Any, int] = {}
        # Workers whose machine failed a task, by task.
        failed_on: dict[int, list[str]] = {}
        crew = _Crew(self.client, self.title)
        try:
            while todo or running or suspects:
                if not todo and not running:
                    todo.append(suspects.popleft())
                    alone = True
                with self._lost():
                    workers = crew.workers()
                    if self.revive is not None:
                        self.revive(len(workers))
                    while todo and len(running) < sum(workers.values()) + AHEAD:
                        index = todo.popleft()
                        failed = failed_on.get(index, [])
                        others = sorted(workers.keys() - set(failed)) if failed else []
                        running[self._submit(job, tasks[index], others)] = index
                    ended = _ended(running)
                for future in ended:
                    index = running.pop(future)
                    with self._lost():
                        result = _result(future, job.time_limit)
                        if result is NOT_YET:
                            running[future] = index
                            continue
                        future.release()
                    if isinstance(result, ClusterError):
                        raise result
                    if isinstance(result, _WorkersDiedError) and not alone:
                        suspects.append(index)
                        continue
                    if isinstance(result, MachineFault):
                        failed_on.setdefault(index, []).append(result.worker)
                        if len(failed_on[index]) <= RETRIES:
                            todo.appendleft(index)
                            continue
                        result = result.error
                    yield index, result
        finally:
            for future in running:
                with suppress(*_gone()):
                    future.cancel(force=True)

    def _submit(self, job: Job, task: tuple[Any, ...], workers: list[str]) -> Any:
        """The task's future. workers : those that are to do it if they can; all, if empty"""
        wanted = {"workers": workers, "allow_other_workers": True} if workers else {}
        # Not pure: a task of an earlier run is never taken for this one.
        return self.client.submit(work, job, task, pure=False, **wanted)

    @contextmanager
    def _lost(self) -> Iterator[None]:
        """A scheduler that is gone ends the run: what was finished is with the caller."""
        try:
            yield
        except _gone() as error:
            raise ClusterError(
                "The Dask scheduler is gone",
                where=self.title,
                found=repr(error),
                fix="start the cluster again, then give the same command again to go on",
            ) from error


def _gone() -> tuple[type[BaseException], ...]:
    """What a client meets when it has lost its scheduler."""
    from distributed.client import ClosedClientError

    return OSError, RuntimeError, CancelledError, ClosedClientError


class _Crew:
    """How many threads each worker has, asked for now and then: workers come and go."""

    def __init__(self, client: Any, title: str) -> None:
        self._client, self._title = client, title
        self._found: dict[str, int] = {}
        self._asked = -math.inf
        self._alone_since: float | None = None

    def workers(self) -> dict[str, int]:
        """Threads, by the worker's address."""
        now = time.monotonic()
        if now - self._asked >= LOOK:
            self._found, self._asked = self._threads(), now
            self._tell_if_alone(now)
        return self._found

    def _threads(self) -> dict[str, int]:
        try:
            return dict(self._client.nthreads())
        except AttributeError as error:
            # What a client that has been closed says.
            raise OSError("the connection was closed") from error

    def _tell_if_alone(self, now: float) -> None:
        if self._found:
            self._alone_since = None
        elif self._alone_since is None:
            self._alone_since = now
        elif now - self._alone_since > NO_WORKERS:
            note(f"No worker is there yet, waiting: {self._title}")
            self._alone_since = math.inf


def _ended(running: dict[Any, int]) -> list[Any]:
    """Futures that have ended; none after a while: workers may have come or gone."""
    from distributed import TimeoutError, wait

    with suppress(TimeoutError):
        wait(list(running), timeout=LOOK, return_when="FIRST_COMPLETED")
    return [future for future in running if future.status != "pending"]


def _result(future: Any, time_limit: float) -> Any:
    """What the task gave; a BrrpError if workers died of it; NOT_YET where its worker died before
    the result could be had, so that another one does the task again. Errors: CancelledError for a
    future of a scheduler that is gone."""
    from distributed import TimeoutError
    from distributed.scheduler import KilledWorker

    try:
        if future.status != "error":
            # Without a limit it would wait for workers that nobody revives meanwhile.
            return future.result(timeout=FETCH)
        error = future.exception(timeout=FETCH)
    except TimeoutError:
        return NOT_YET
    except KilledWorker as killed:
        error = killed
    if isinstance(error, KilledWorker):
        return _WorkersDiedError(
            "The worker process died",
            expected=f"a result within {time_limit:g} s",
            found=f"{error.allowed_failures + 1} workers died of it",
        )
    # `work` catches what goes wrong in a task, so that this is not the task's.
    return ClusterError(
        "A worker cannot run brrp's tasks",
        found=" ".join(repr(error).split()),
        fix="install the same versions of brrp, Dask and Python on all machines",
    )


@contextmanager
def _local(workers: int) -> Iterator[tuple[Any, Callable[[int], None]]]:
    """A client of `workers` workers with one thread each, started on this machine, and what starts
    others in place of those that are lost for good."""
    import dask
    from distributed import Client, LocalCluster

    with ExitStack() as stack:
        # A nanny starts its worker again at once. Dask gives the nanny up if that takes longer.
        stack.enter_context(dask.config.set({"distributed.deploy.lost-worker-timeout": RESTART}))
        try:
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                # A limit for each would kill what a process of its own may finish.
                memory_limit=0,
                dashboard_address=":0",
                silence_logs=logging.CRITICAL,
            )
        except (OSError, RuntimeError, TimeoutError) as error:
            raise cannot_start(error) from error
        client = stack.enter_context(Client(stack.enter_context(cluster)))

        def revive(there: int) -> None:
            if there < workers:
                cluster.scale(workers)

        yield client, revive


def _address(scheduler: str) -> str:
    """The address, read from the scheduler file if it is one. Errors: ClusterError."""
    if not scheduler.endswith(".json"):
        return scheduler
    try:
        return str(json.loads(Path(scheduler).read_bytes())["address"])
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise ClusterError(
            "This is no scheduler file of Dask",
            where=scheduler,
            expected="what dask scheduler --scheduler-file wrote",
            found=repr(error),
        ) from error


def _no_answer(address: str, error: Exception) -> ClusterError:
    return ClusterError(
        "No Dask scheduler answers",
        where=address,
        found=" ".join(str(error).split()) or type(error).__name__,
        expected="tcp://HOST:8786 as dask scheduler prints it, its scheduler file, or local:N",
        fix="start one with dask scheduler, and check that this machine reaches its port",
    )


@contextmanager
def _quiet_logs() -> Iterator[None]:
    """What Dask logs of workers that come and go is for --verbose."""
    if logging.getLogger("brrp_cli").isEnabledFor(logging.DEBUG):
        yield
        return
    # Dask gives levels to loggers of its parts, too.
    parts = [name for name in logging.root.manager.loggerDict if name.startswith("distributed.")]
    loggers = [logging.getLogger(name) for name in ("distributed", "tornado", *parts)]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
