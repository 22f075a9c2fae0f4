"""The one door to workers: the same tasks give the same results wherever they run."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from brrp_cli.errors import BrrpError
from brrp_cli.executors.processes import Processes
from brrp_cli.threads import cores


class Executor(Protocol):
    """What runs one function on many tasks. title : for people, such as "2 processes"."""

    title: str

    def run(
        self,
        function: Callable[..., Any],
        tasks: Sequence[tuple[Any, ...]],
        time_limit: float,
        *,
        reads: Sequence[Path] = (),
        writes: Path | None = None,
    ) -> Generator[tuple[int, Any], None, None]:
        """Yield (index, result) as tasks end; a failed task's result is a BrrpError.

        function : importable by name; called with each task's values, one task at a time in a
        process, numeric libraries with one thread.
        time_limit : seconds for one task.
        reads, writes : files and folders that tasks read, and the folder that they write into,
        which workers on other machines must see under the same paths.
        Results that nobody has taken yet do not pile up. Errors: BrrpError where no worker starts,
        ClusterError where a cluster cannot go on.
        """


@contextmanager
def open_executor(workers: int | None = None, scheduler: str | None = None) -> Iterator[Executor]:
    """Processes here, as many as `workers` (None: as processors), or the cluster of `scheduler`:
    the address of a Dask scheduler, its scheduler file (.json), or local:N.

    Errors: BrrpError if both are given; DependencyError without Dask; ClusterError for a scheduler
    that does not answer.
    """
    if scheduler is None:
        yield Processes(workers or cores())
        return
    if workers is not None:
        raise BrrpError(
            "--workers and --scheduler exclude each other",
            found=f"--workers {workers} --scheduler {scheduler}",
            fix=f"--scheduler local:{workers} starts {workers} Dask workers on this machine; "
            "another cluster has its own number",
        )
    from brrp_cli.executors.cluster import open_cluster

    with open_cluster(scheduler) as cluster:
        yield cluster
