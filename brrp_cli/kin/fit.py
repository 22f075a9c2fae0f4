"""The best stretched shapes for what was seen of one object, and how well each explains it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import KinConfig
from brrp_cli.geometry import bell, transform_points
from brrp_cli.kin.evidence import Evidence
from brrp_cli.kin.library import Library
from brrp_cli.kin.placement import KinPlacements, distance_and_slopes
from brrp_cli.kin.proposals import starts
from brrp_cli.kin.refine import refined

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Fits:
    """Placements, best first, with what speaks for and against each, (B,).

    near : mean of a Gaussian of the seen points' distances; far : mean of these, limited, over the
    limit; violation : share of the surface in free space or below the plane; inside : share of free
    points within; lost : share of seen points that it does not explain at all; size, stretch : of
    the logarithms of the scales; score : of all of it
    """

    placements: KinPlacements
    near: Floats
    far: Floats
    violation: Floats
    inside: Floats
    lost: Floats
    size: Floats
    stretch: Floats
    score: Floats

    def __getitem__(self, rows: NDArray[np.integer]) -> Fits:
        return Fits(
            self.placements[rows],
            self.near[rows],
            self.far[rows],
            self.violation[rows],
            self.inside[rows],
            self.lost[rows],
            self.size[rows],
            self.stretch[rows],
            self.score[rows],
        )


def judged(
    placements: KinPlacements, evidence: Evidence, library: Library, config: KinConfig
) -> Fits:
    """Placements with their scores, in their order."""
    distance = distance_and_slopes(
        placements, np.concatenate([evidence.seen, evidence.free]), library
    )[0]
    on, at = distance[:, : len(evidence.seen)], distance[:, len(evidence.seen) :]
    near = bell(on / math.hypot(config.near, evidence.noise)).mean(axis=1)
    far = (np.minimum(np.abs(on), config.far) / config.far).mean(axis=1)
    lost = (np.abs(on) > config.lost).mean(axis=1)
    inside = np.clip((-at - config.tolerance) / config.slope, 0, 1).sum(axis=1) / max(
        at.shape[1], 1
    )
    violation = _violation(placements, evidence, library, config)
    log = np.log(placements.half / library.half[placements.stance])
    mean = log.mean(axis=1)
    stretch = np.sqrt(np.square(log - mean[:, None]).sum(axis=1))
    score = (
        near
        - far
        - config.violation_weight * violation
        - config.free_weight * inside
        - config.lost_weight * lost
        - config.pull * (np.square(mean / config.size_deviation))
        - config.pull * np.square(stretch / config.stretch_deviation)
        - config.pull * np.square(placements.taper / config.taper_deviation)
    )
    return Fits(placements, near, far, violation, inside, lost, mean, stretch, score)


def _violation(
    placements: KinPlacements, evidence: Evidence, library: Library, config: KinConfig
) -> Floats:
    """Share (B,) of the surface that lies in front of the measured depth, or below the plane."""
    placed = placements.placed(library.surface[placements.stance]).reshape(3, -1).T
    gap = evidence.free_depth(transform_points(evidence.T_cam_plane, placed))
    below = -placed[:, 2]
    worst = np.fmax(np.nan_to_num(gap, nan=-1.0), below)
    ramp = np.clip((worst - config.tolerance) / config.slope, 0, 1)
    return np.asarray(ramp.reshape(len(placements), -1).mean(axis=1), dtype=np.float32)


def fit_kin(evidence: Evidence, library: Library, config: KinConfig) -> Fits:
    """The best `config.kept` fits, best first; none where nothing was plausible."""
    begun = starts(evidence, library, config)
    if not len(begun):
        return judged(begun, evidence, library, config)
    some = replace(
        evidence, seen=evidence.seen[: config.step_seen], free=evidence.free[: config.step_free]
    )
    first = replace(config, steps=config.first_steps)
    rest = replace(config, steps=config.steps - config.first_steps)
    fits = _best(refined(begun, some, library, first), some, library, config, config.middle)
    fits = _best(refined(fits.placements, some, library, rest), some, library, config, config.kept)
    every = replace(config, step_seen=len(evidence.seen), step_free=len(evidence.free))
    placements = refined(fits.placements, evidence, library, every)
    return _best(placements, evidence, library, config, config.kept)


def _best(
    placements: KinPlacements, evidence: Evidence, library: Library, config: KinConfig, count: int
) -> Fits:
    """The `count` best, best first."""
    fits = judged(placements, evidence, library, config)
    return fits[np.argsort(-fits.score, kind="stable")[:count]]
