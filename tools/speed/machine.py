"""What this machine can do, and how long the work of an object would take at that rate."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from brrp_cli.completion.point_features import COUNT
from brrp_cli.config import Config
from brrp_cli.threads import cores

TRIES = 5
# Operations on a point that slides: placed (18), value and slope between eight nodes (60), a row of
# six and what it adds to a 6 x 6 matrix (60); on one that is judged: placed, looked up (40).
SLID, JUDGED = 138, 60
# Bytes of the eight nodes or the pixel, and of the point.
SLID_BYTES, JUDGED_BYTES = 8 * 4 + 12, 8 * 4 + 12


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
    judged = (starts + search.coarse + search.middle) * (search.model_points + search.seen_points)
    judged += (search.fine + len(search.sizes) * search.rescaled) * 2 * search.fine_points
    slid = (
        search.coarse * search.coarse_points * search.coarse_steps
        + search.middle * search.middle_points * search.middle_steps
        + search.fine * search.fine_points * search.fine_steps
        + len(search.sizes) * search.rescaled * search.middle_points * search.middle_steps
    )
    placing = config.k * (judged * JUDGED + slid * SLID)
    placing += config.k * search.matchings * search.matching.iterations * 40
    placing_bytes = config.k * (judged * JUDGED_BYTES + slid * SLID_BYTES)

    hinges, particles = fitted.hinges, fitted.particles
    steps = 4 * fitted.steps * fitted.batch * hinges * particles
    steps_bytes = fitted.steps * 4 * (fitted.batch * hinges / 10 + 6 * particles * hinges)
    # The network of the completion, at every eighth node: two hidden layers of 64; each other mean
    # looks up eight nodes.
    means = nodes * ((COUNT * 64 + 64 * 64) / 4 + search.kept * 40)
    means_bytes = nodes * 4 * ((COUNT + 2 * 64) / 8 + 8 * search.kept)
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
