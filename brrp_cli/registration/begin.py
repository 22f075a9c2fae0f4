"""How a search for poses begins: many placements, brought a little nearer, of which the best go on.

How well a placement lies says little of how well it will lie once it is refined: a mug whose handle
points aside by 30 degrees is worse than one on its head, and becomes right. So the best are chosen
after a few steps with few points, which cost little more than the scores.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig
from brrp_cli.registration.model import ModelGeometry
from brrp_cli.registration.sdf_refinement import refine_to_sdf
from brrp_cli.registration.transform_loops import inverses
from brrp_cli.registration.verification import Verifier

Array = NDArray[np.float64]


def best_brought_nearer(
    T_cam_model: Array, model: ModelGeometry, verifier: Verifier, config: SearchConfig
) -> tuple[Array, Array]:
    """The `coarse` best of placements (B, 4, 4) after `begun_steps` steps with `begun_points`
    observed points, best first, and their scores. Of more than `begun`, or `sifted` of them, only
    the best begin."""
    T, count = T_cam_model, min(config.begun, math.ceil(config.sifted * len(T_cam_model)))
    if len(T) > count:
        T, _ = best_of(T, model, verifier, config, count, config.sifting_share)
    T = brought_nearer(
        T,
        model,
        verifier,
        config,
        config.begun_points,
        config.coarse_distance,
        config.begun_steps,
    )
    return best_of(T, model, verifier, config, config.coarse, config.first_share)


def best_of(
    T_cam_model: Array,
    model: ModelGeometry,
    verifier: Verifier,
    config: SearchConfig,
    count: int,
    share: int = 1,
) -> tuple[Array, Array]:
    """The `count` best placements by a coarse alignment score, with one of `share` of its points,
    best first, and their scores."""
    score = coarse_score(T_cam_model, model, verifier, config, share)
    order = np.argsort(-score, kind="stable")[:count]
    return np.asarray(T_cam_model[order]), np.asarray(score[order])


def coarse_score(
    T_cam_model: Array,
    model: ModelGeometry,
    verifier: Verifier,
    config: SearchConfig,
    share: int = 1,
) -> Array:
    """Of placements (B, 4, 4), with one of `share` points of a coarse alignment score."""
    return verifier.score(
        T_cam_model,
        model,
        config.alignment_score,
        model_points=config.model_points // share,
        seen_points=config.seen_points // share,
    )


def brought_nearer(
    T_cam_model: Array,
    model: ModelGeometry,
    verifier: Verifier,
    config: SearchConfig,
    points: int,
    distance: float,
    steps: int,
) -> Array:
    """Each placement (B, 4, 4) with so many observed points brought onto its surface; its size
    stays. Points further from it than `distance` metres do not pull. Where depth shows too little
    of the object, a placement that is none the better stays as it was."""
    seen = verifier.points[:points]
    T = inverses(refine_to_sdf(inverses(T_cam_model), seen, model, distance, steps))
    if verifier.mask is None:
        return T
    before = coarse_score(T_cam_model, model, verifier, config)
    better = coarse_score(T, model, verifier, config) > before
    return np.where(better[:, None, None], T, T_cam_model)
