"""Meshes decomposed into convex parts, each in a process of its own.

CoACD runs for up to a minute without looking up: in this process Ctrl-C would wait for it, and what
kills it would kill the command. Several meshes are decomposed side by side.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.planning import PartsConfig
from brrp_cli.errors import BrrpError, ResultError
from brrp_cli.planning.parts import COACD, HULL, convex_parts
from brrp_cli.threads import cores

Array = NDArray[np.float64]

# Ctrl-C goes to all processes of a terminal; Python would see it only after CoACD's return.
_BEGIN = (
    "import signal; signal.signal(signal.SIGINT, signal.SIG_DFL);"
    "from brrp_cli.planning.decompose import serve; serve()"
)


@dataclass(frozen=True)
class NamedMesh:
    """A closed mesh: vertices (n, 3), faces (m, 3). name : for messages"""

    name: str
    vertices: Array
    faces: NDArray[np.int64]


def parts_of(
    solids: Sequence[NamedMesh], how: str, seed: int, config: PartsConfig
) -> Iterator[list[Array]]:
    """The convex parts of each solid, in their order, as `convex_parts` makes them.

    Errors: those of `convex_parts`; ResultError where a process died over it.
    """
    if how != COACD:
        yield from (convex_parts(each.vertices, each.faces, how, seed, config) for each in solids)
        return
    running = _Running()
    with ThreadPoolExecutor(max(min(len(solids), cores()), 1)) as pool:
        futures = [pool.submit(running.decompose, each, seed, config) for each in solids]
        try:
            for future in futures:
                yield future.result()
        finally:
            # Also where somebody pressed Ctrl-C.
            pool.shutdown(wait=False, cancel_futures=True)
            running.kill()


def serve() -> None:
    """One task from standard input; its answer, parts or an error, goes to standard output."""
    args = pickle.load(sys.stdin.buffer)
    answer: list[Array] | BrrpError
    try:
        answer = convex_parts(*args)
    except BrrpError as error:
        answer = error
    sys.stdout.buffer.write(pickle.dumps(answer))


@dataclass
class _Running:
    """The processes that run."""

    processes: set[subprocess.Popen[bytes]] = field(default_factory=set)
    killed: bool = False
    lock: Lock = field(default_factory=Lock)

    def decompose(self, solid: NamedMesh, seed: int, config: PartsConfig) -> list[Array]:
        task = pickle.dumps((solid.vertices, solid.faces, COACD, seed, config))
        with self.lock:
            if self.killed:
                return []
            process = subprocess.Popen(
                [sys.executable, "-c", _BEGIN],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
            self.processes.add(process)
        output, words = process.communicate(task)
        with self.lock:
            self.processes.discard(process)
        if process.returncode != 0:
            raise _died(solid.name, process.returncode, words)
        answer: Any = pickle.loads(output)
        if isinstance(answer, BrrpError):
            raise answer
        parts: list[Array] = answer
        return parts

    def kill(self) -> None:
        with self.lock:
            self.killed = True
            for process in self.processes:
                process.kill()


def _died(name: str, code: int, words: bytes) -> ResultError:
    last = words.decode(errors="replace").strip().splitlines()[-1:]
    return ResultError(
        "CoACD died over a mesh",
        where=name,
        found=f"exit status {code}" + (f": {last[0]}" if last else ""),
        fix=f"take --collision {HULL}, which fills hollows",
    )
