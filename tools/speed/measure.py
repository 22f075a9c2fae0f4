"""Clocks: warm calls, cold commands, medians and spread."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Spread:
    """Median, least and greatest of repeated measurements, seconds."""

    median: float
    least: float
    most: float
    count: int

    def as_dict(self) -> dict[str, float]:
        """For JSON."""
        return {k: round(v, 5) for k, v in asdict(self).items()}


def spread(seconds: Sequence[float]) -> Spread:
    """Of at least one measurement."""
    return Spread(
        float(np.median(seconds)), float(np.min(seconds)), float(np.max(seconds)), len(seconds)
    )


@dataclass(frozen=True)
class Run:
    """One call: what it returned, and seconds of the clock on the wall and of all cores."""

    result: Any
    wall: float
    cpu: float


def run(call: Callable[[], Any], processes: Sequence[int] = ()) -> Run:
    """Call once. processes : others that share the work, whose CPU counts, too"""
    wall, cpu = time.perf_counter(), time.process_time() + _cpu_of(processes)
    result = call()
    return Run(
        result,
        time.perf_counter() - wall,
        time.process_time() + _cpu_of(processes) - cpu,
    )


def _cpu_of(processes: Sequence[int]) -> float:
    """CPU seconds, user and system, of processes by their numbers, so far."""
    ticks = 0
    for number in processes:
        # Behind the name, which may hold anything, in brackets.
        told = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
        ticks += int(told[11]) + int(told[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def own_megabytes(process: int) -> float:
    """What a process holds in memory that it shares with no other."""
    lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    kibibytes = sum(int(line.split()[1]) for line in lines if line.startswith("Private_"))
    return kibibytes * 1024 / 1e6


@dataclass(frozen=True)
class Cold:
    """A command from nothing: CPU seconds (user and system, imports included), seconds on the wall,
    and its greatest resident memory, megabytes."""

    cpu: float
    wall: float
    megabytes: float


_WATCH = """
import resource, subprocess, sys
code = subprocess.call(sys.argv[1:], stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss)
sys.exit(code)
"""


def cold(*arguments: str | Path) -> Cold:
    """`brrp ARGUMENTS` as a process of its own; of its workers the CPU counts too, and the memory
    is that of the greatest of all. Errors: SystemExit if the command fails."""
    command = [sys.executable, "-m", "brrp_cli", "-q", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    start = time.perf_counter()
    # Through a small process: a child's greatest memory begins with that of who started it.
    told = subprocess.run(
        [sys.executable, "-c", _WATCH, *command],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    if told.returncode:
        raise SystemExit(f"brrp {arguments[0]} ended with {told.returncode}")
    cpu, kilobytes = (float(word) for word in told.stdout.split())
    return Cold(cpu, time.perf_counter() - start, kilobytes * 1024 / 1e6)


def cold_reconstruct(frame: Path, prior: Path, output: Path) -> Cold:
    """`brrp reconstruct FRAME` from nothing."""
    return cold("reconstruct", frame, "--prior", prior, "-o", output, "--overwrite")


def peak_megabytes() -> float:
    """Greatest resident memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
