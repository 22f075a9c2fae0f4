"""Where stretched shapes are tried first: every stance, turned, in a few sizes that what is seen
suggests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import KinConfig
from brrp_cli.geometry import bell
from brrp_cli.kin.evidence import Evidence
from brrp_cli.kin.library import Library
from brrp_cli.kin.placement import KinPlacements, coarse_distance, joined

Floats = NDArray[np.float32]

CHUNK = 512


def proposals(evidence: Evidence, library: Library, config: KinConfig) -> KinPlacements:
    """All that are no larger, smaller or more stretched than is plausible, stance after stance."""
    seen, size = evidence.seen, library.half
    top = max(float(np.quantile(seen[:, 2], config.most[1])), 2 * config.least_half)
    stances, found = np.arange(len(size)), []
    toward = evidence.eye[:2] - seen[:, :2].mean(axis=0)
    for turn in 2 * np.pi / config.turns * np.arange(config.turns):
        axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        low, high = np.quantile(seen[:, :2] @ axes.T, config.most, axis=0)
        shown = np.maximum((high - low) / 2, config.least_half)
        near = np.sign(axes @ toward)
        upright = np.full(len(size), top / 2)
        flat = np.max(shown / size[:, :2], axis=1)[:, None] * size[:, :2]
        by_height = (upright / size[:, 2])[:, None] * size[:, :2]
        for wide, tall in (
            (flat, upright),
            (np.broadcast_to(shown, flat.shape), upright),
            (by_height, upright),
            (size[:, :2], size[:, 2]),
        ):
            # What is seen of a longer thing is the side towards the camera.
            over = np.maximum(wide - shown, 0)
            middle = ((low + high) / 2 - near * over) @ axes
            found.append(
                KinPlacements(
                    stances,
                    np.full(len(size), turn, np.float32),
                    np.column_stack([middle, tall]).astype(np.float32),
                    np.column_stack([wide, tall]).astype(np.float32),
                    np.zeros(len(size), np.float32),
                )
            )
    every = joined(found)
    log = np.log(every.half / library.half[every.stance])
    mean = log.mean(axis=1)
    plausible = (np.abs(mean) < config.most_size) & (
        np.abs(log - mean[:, None]).max(axis=1) < config.most_stretch
    )
    rows = np.flatnonzero(plausible)
    # A stance's field is in the cache while all of its proposals are judged.
    return every[rows[np.argsort(every.stance[rows], kind="stable")]]


def starts(evidence: Evidence, library: Library, config: KinConfig) -> KinPlacements:
    """The best proposals by the coarse fields, few of one shape."""
    every = proposals(evidence, library, config)
    score = np.concatenate(
        [
            _score(every[np.arange(a, min(a + CHUNK, len(every)))], evidence, library, config)
            for a in range(0, len(every), CHUNK)
        ]
        or [np.zeros(0, np.float32)]
    )
    order = np.argsort(-score, kind="stable")
    shape = library.object[every.stance[order]]
    taken: dict[int, int] = {}
    first: list[int] = []
    others: list[int] = []
    for row, number in zip(order, shape, strict=True):
        taken[int(number)] = taken.get(int(number), 0) + 1
        (first if taken[int(number)] <= config.starts_each else others).append(int(row))
        if len(first) == config.starts:
            break
    # Where the shapes are few, each gets more.
    return every[np.array([*first, *others][: config.starts], np.int64)]


def _score(
    placements: KinPlacements, evidence: Evidence, library: Library, config: KinConfig
) -> Floats:
    seen, free = evidence.seen[: config.coarse_seen], evidence.free[: config.coarse_free]
    distance = coarse_distance(placements, np.concatenate([seen, free]), library)
    on, at = distance[:, : len(seen)], distance[:, len(seen) :]
    near = bell(on / config.coarse_near).mean(axis=1)
    far = np.minimum(np.abs(on) / (config.coarse_far * config.coarse_near), 1).mean(axis=1)
    inside = np.clip(-at / config.coarse_near, 0, 1).sum(axis=1) / max(len(free), 1)
    log = np.log(placements.half / library.half[placements.stance])
    mean = log.mean(axis=1, keepdims=True)
    stretch = np.square(log - mean).sum(axis=1) / config.stretch_deviation**2
    size = np.square(mean[:, 0]) / config.size_deviation**2
    return np.asarray(
        near
        - config.coarse_far_weight * far
        - config.free_weight * inside
        - config.coarse_pull * config.pull * (stretch + size)
    )
