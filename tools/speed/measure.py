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


def run(call: Callable[[], Any]) -> Run:
    """Call once."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = call()
    return Run(result, time.perf_counter() - wall, time.process_time() - cpu)


@dataclass(frozen=True)
class Cold:
    """A command from nothing: CPU seconds (user and system, imports included), seconds on the wall,
    and its greatest resident memory, megabytes."""

    cpu: float
    wall: float
    megabytes: float


def cold_reconstruct(frame: Path, prior: Path, output: Path) -> Cold:
    """`brrp reconstruct FRAME` as a process of its own."""
    command = [sys.executable, "-m", "brrp_cli", "-q", "reconstruct", str(frame)]
    command += ["--prior", str(prior), "-o", str(output), "--overwrite"]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    start = time.perf_counter()
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as process:
        # Of this child alone; RUSAGE_CHILDREN holds the greatest of all that there were.
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"brrp reconstruct ended with {process.returncode}")
    return Cold(
        usage.ru_utime + usage.ru_stime, time.perf_counter() - start, usage.ru_maxrss * 1024 / 1e6
    )


def peak_megabytes() -> float:
    """Greatest resident memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
