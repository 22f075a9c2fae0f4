"""What this machine can do, and how long the work of an object would take at that rate."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from brrp_cli.config import Config
from brrp_cli.threads import cores

TRIES = 5
# Operations of one descent to the nearest of 2,000 points in a k-d tree, and bytes of the nodes on
# the way: 11 levels and about two leaves of 8 points.
DESCENT, DESCENT_BYTES = 11 * 4 + 16 * 8, 11 * 32 + 16 * 24
# Iterations until ICP stands still, as measured.
ICP_STEPS = 12


@dataclass(frozen=True)
class Machine:
    """One core's float32 matrix products (operations a second) and copies (bytes a second)."""

    processor: str
    cores: int
    flops: float
    bandwidth: float


@dataclass(frozen=True)
class Limit:
    """Least work of a stage for one object, and the seconds of one core that it takes at best."""

    operations: float
    bytes: float
    seconds: float


def measure_machine() -> Machine:
    """By a matrix product and a copy that are far larger than any cache."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        a = torch.ones(1024, 1024)
        flops = 2 * 1024**3 / _best(lambda: a @ a)
        source, target = np.ones(2**25, np.float32), np.zeros(2**25, np.float32)
        bandwidth = 2 * source.nbytes / _best(lambda: np.copyto(target, source))
    finally:
        torch.set_num_threads(threads)
    return Machine(_processor(), cores(), flops, bandwidth)


def limits(machine: Machine, config: Config, samples: int) -> dict[str, Limit]:
    """Of one object with so many observed samples near it, by stages of `default`."""
    hypotheses = config.hypotheses
    assert hypotheses is not None
    search, fitted, nodes = hypotheses.search, hypotheses.map, hypotheses.mean.nodes

    starts = search.matchings + 8 * search.turns
    judged = starts * (300 + search.seen_points) + (search.coarse + search.fine) * (
        300 + search.seen_points
    )
    refined = (
        search.coarse * search.coarse_points
        + search.fine * search.fine_points
        + len(search.scales) * search.rescaled * search.coarse_points
    )
    # A point that is judged: placed (18), projected or looked up between eight nodes (40).
    # A pair of ICP: the nearest point, and 21 entries of a 6 x 6 matrix.
    queries = refined * ICP_STEPS
    placing = config.k * (judged * 60 + queries * (DESCENT + 60))
    placing += config.k * search.matchings * search.matching.iterations * 40
    placing_bytes = config.k * (judged * 64 + queries * DESCENT_BYTES)

    hinges, particles = fitted.hinges, fitted.particles
    steps = 4 * fitted.steps * fitted.batch * hinges * particles
    steps_bytes = fitted.steps * 4 * (fitted.batch * hinges / 10 + 6 * particles * hinges)
    # The network of the completion: two hidden layers of 64; each other mean looks up eight nodes.
    means = nodes * (2 * (35 * 64 + 64 * 64) + search.kept * 40)
    means_bytes = nodes * 4 * (35 + 2 * 64 + 8 * search.kept)
    # Separable, axis after axis: the last axis costs most.
    side = hinges ** (1 / 3)
    volume = 2 * particles * nodes * side + particles * nodes * 20
    volume_bytes = 8 * particles * nodes
    work = {
        "registration": (placing, placing_bytes),
        "inference": (steps + means, steps_bytes + means_bytes),
        "surface": (volume, volume_bytes),
    }
    return {
        stage: Limit(ops, moved, max(ops / machine.flops, moved / machine.bandwidth))
        for stage, (ops, moved) in work.items()
    }


def _best(call: Callable[[], object]) -> float:
    call()
    seconds = []
    for _ in range(TRIES):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def _processor() -> str:
    path = Path("/proc/cpuinfo")
    if path.is_file():
        for line in path.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
