"""Many hypotheses of where a stored object is: begin widely, refine the best, verify all.

The paper's scan (scan.py) takes the one placement with most inlier pairs, at ten fixed sizes. Here
a stored object keeps its own size, or one near it; starts are resting poses turned about the
table's normal and feature matchings; what decides is what the whole image says (testimony.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig, SearchConfig
from brrp_cli.geometry import transform_points
from brrp_cli.registration.initial_poses import matched_starts, resting_starts
from brrp_cli.registration.model import COARSE, Model
from brrp_cli.registration.scale_scan import ObservedCloud
from brrp_cli.registration.sdf_refinement import descend
from brrp_cli.registration.verification import Testimony

Array = NDArray[np.float64]

# The first look at all starts takes one point of so many, and leaves so many times what slides.
GLANCE, GLANCED = 3, 2


@dataclass(frozen=True)
class Hypothesis:
    """A stored object placed in the scene.

    T_cam_model : (4, 4) similarity from the model (metres, true size); scale : of it, 1 is the true
    size; evidence : what the frame says of it, 1 at best, less what its scale costs
    """

    model: Model
    T_cam_model: Array
    scale: float
    evidence: float

    @property
    def T_cam_object(self) -> Array:
        """(4, 4) similarity from the stored object's normalised coordinates."""
        return np.asarray(self.T_cam_model @ self.model.T_model_object)


def search(
    model: Model,
    observed: ObservedCloud,
    testimony: Testimony,
    features: FeatureConfig,
    config: SearchConfig,
    seed: int,
    best: float = -np.inf,
) -> list[Hypothesis]:
    """The best placements of one model that differ in shape, best first, `config.kept` at most.

    best : evidence that another model has reached
    """
    starts = matched_starts(model, observed, features, config.matching, config.matchings, seed)
    if testimony.plane is not None:
        starts += resting_starts(model, testimony.points, testimony.plane, config.turns)
    T = np.stack(starts)
    T, _ = _best(T, model, testimony, config, GLANCED * config.coarse, GLANCE)
    T, _ = _best(T, model, testimony, config, config.coarse)
    T = _slid(
        T, model, testimony, config.coarse_points, config.coarse_distance, config.coarse_steps
    )
    least = max(config.hopeless, best - config.beaten)
    for count, points, distance, steps in (
        (config.middle, config.middle_points, config.coarse_distance, config.middle_steps),
        (config.fine, config.fine_points, config.fine_distance, config.fine_steps),
    ):
        T, reached = _best(T, model, testimony, config, count)
        if reached < least:
            return _distinct(_judged(T[: config.fine], 1.0, model, testimony, config), config)
        T = _slid(T, model, testimony, points, distance, steps)
    found = _judged(T, 1.0, model, testimony, config)
    parents = [each.T_cam_model for each in found[: config.rescaled]]
    for scale in config.scales if found[0].evidence < config.settled else ():
        resized = np.stack([_resize(parent, scale, testimony) for parent in parents])
        resized = _slid(
            resized,
            model,
            testimony,
            config.middle_points,
            config.scale_distance,
            config.middle_steps,
        )
        found += _judged(resized, scale, model, testimony, config)
    return _distinct(sorted(found, key=lambda each: -each.evidence), config)


def _distinct(found: list[Hypothesis], config: SearchConfig) -> list[Hypothesis]:
    """Without those whose surface lies within `config.distinct` metres, on average, of that of a
    better one: a ball turned about its middle is one hypothesis, not many."""
    kept: list[Hypothesis] = []
    for each in found:
        surface = transform_points(each.T_cam_model, each.model.surface[:COARSE])
        apart = (
            np.abs(other.model.signed_distance(transform_points(T_model_cam, surface))).mean()
            for other in kept
            for T_model_cam in [np.linalg.inv(other.T_cam_model)]
        )
        if all(distance > config.distinct for distance in apart):
            kept.append(each)
        if len(kept) == config.kept:
            break
    return kept


def _best(
    T_cam_model: Array,
    model: Model,
    testimony: Testimony,
    config: SearchConfig,
    count: int,
    share: int = 1,
) -> tuple[Array, float]:
    """The `count` best placements by a first look at their evidence, with one of `share` of its
    points, and the best of that."""
    score = testimony.score(
        T_cam_model,
        model,
        config.evidence,
        model_points=COARSE // share,
        seen_points=config.seen_points // share,
    )
    order = np.argsort(-score, kind="stable")[:count]
    return np.asarray(T_cam_model[order]), float(score[order[0]])


def _judged(
    T_cam_model: Array, scale: float, model: Model, testimony: Testimony, config: SearchConfig
) -> list[Hypothesis]:
    score = testimony.score(
        T_cam_model,
        model,
        config.evidence,
        model_points=config.fine_points,
        seen_points=config.fine_points,
    )
    score = score - config.scale_cost * np.log(scale) ** 2
    found = [Hypothesis(model, T, scale, float(s)) for T, s in zip(T_cam_model, score, strict=True)]
    return sorted(found, key=lambda each: -each.evidence)


def _slid(
    T_cam_model: Array, model: Model, testimony: Testimony, points: int, distance: float, steps: int
) -> Array:
    """Each placement (B, 4, 4) with so many observed points brought onto its surface; its size
    stays. Points further from it than `distance` metres do not pull."""
    T_model_cam = np.asarray(np.linalg.inv(T_cam_model), dtype=np.float64)
    seen = testimony.points[:points]
    return np.asarray(np.linalg.inv(descend(T_model_cam, seen, model, distance, steps)))


def _resize(T_cam_model: Array, scale: float, testimony: Testimony) -> Array:
    """Grown by `scale` about the middle of what is seen."""
    center = testimony.points.mean(axis=0)
    T = T_cam_model.copy()
    T[:3, :3] *= scale
    T[:3, 3] = center + scale * (T[:3, 3] - center)
    return T
