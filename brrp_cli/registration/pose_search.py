"""Many hypotheses of where a stored object is: begin widely, refine the best, verify all.

The paper's scan (scale_scan.py) takes the one placement with most inlier pairs, at ten fixed sizes.
Here a stored object keeps its own size, or one near it. The search begins with resting poses turned
about the table's normal, with leaning ones and with feature matchings; what decides is what the
whole image says (verification.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config import FeatureConfig, SearchConfig
from brrp_cli.geometry import as_transforms, transform_points
from brrp_cli.registration.begin import best_brought_nearer, best_of, brought_nearer, coarse_score
from brrp_cli.registration.initial_poses import feature_matched_poses
from brrp_cli.registration.leaning_poses import resting_and_leaning
from brrp_cli.registration.model import Model
from brrp_cli.registration.print_agreement import print_agreement
from brrp_cli.registration.scale_scan import ObservedCloud
from brrp_cli.registration.sdf_refinement import refine_to_sdf
from brrp_cli.registration.transform_loops import inverses
from brrp_cli.registration.turns import (
    about_main_axes,
    best_and_different,
    turns_about_itself,
    without_same,
)
from brrp_cli.registration.verification import Verifier

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hypothesis:
    """A stored object placed in the scene.

    T_cam_model : (4, 4) similarity from the model (metres, true size); scale : of it, 1 is the true
    size; alignment_score : what the frame says of it, 1 at best, less what its scale costs
    """

    model: Model
    T_cam_model: Array
    scale: float
    alignment_score: float

    @property
    def T_cam_object(self) -> Array:
        """(4, 4) similarity from the stored object's normalised coordinates."""
        return np.asarray(self.T_cam_model @ self.model.T_model_object)


def search(
    model: Model,
    observed: ObservedCloud,
    verifier: Verifier,
    features: FeatureConfig,
    config: SearchConfig,
    seed: int,
    best: float = -np.inf,
) -> list[Hypothesis]:
    """The best placements of one model that differ in shape, best first, `config.kept` at most; of
    one that cannot win, the best.

    best : alignment score that another model has reached
    """
    by_mask = np.zeros((0, 4, 4)) if verifier.mask is None else verifier.mask.poses(model)
    T = _initial_poses(model, observed, verifier, features, config, seed)
    T = np.concatenate([by_mask, T])
    T, scores = best_brought_nearer(T, model, verifier, config)
    if scores[0] < config.unpromising:
        return _judged(T[:1], model, verifier, config)
    T = brought_nearer(
        T,
        model,
        verifier,
        config,
        config.coarse_points,
        config.coarse_distance,
        config.coarse_steps,
    )
    least = max(config.hopeless, best - config.beaten)
    for count, points, distance, steps in (
        (config.middle, config.middle_points, config.coarse_distance, config.middle_steps),
        (config.fine, config.fine_points, config.fine_distance, config.fine_steps),
    ):
        T, scores = best_of(T, model, verifier, config, count)
        if scores[0] < least:
            return _judged(T[:1], model, verifier, config)
        T = brought_nearer(different(T, config), model, verifier, config, points, distance, steps)
    found = _judged(T, model, verifier, config)
    found = by_colour(found, verifier, config)
    if found[0].alignment_score < config.settled:
        found += _of_other_sizes(found, model, verifier, config)
    return _distinct(sorted(found, key=lambda each: -each.alignment_score), config)


def _initial_poses(
    model: Model,
    observed: ObservedCloud,
    verifier: Verifier,
    features: FeatureConfig,
    config: SearchConfig,
    seed: int,
) -> Array:
    """T_cam_model (B, 4, 4): by matching features, resting, leaning."""
    matched = feature_matched_poses(
        model, observed, features, config.matching, config.matchings, seed
    )
    every = resting_and_leaning(model, verifier.outline(config), config)
    return np.concatenate([np.stack(matched), every])


def start_from(
    T_cam_model: Array, scale: Array, model: Model, verifier: Verifier, config: SearchConfig
) -> list[Hypothesis]:
    """Placements (B, 4, 4) that were found in an earlier frame, and `scale` (B,) of each: as they
    were and refined to this frame, those that differ, best first."""
    moved = brought_nearer(
        T_cam_model,
        model,
        verifier,
        config,
        config.fine_points,
        config.fine_distance,
        config.fine_steps,
    )
    log = np.log(scale)
    resized = np.abs(log) > config.least_size_change
    cost = np.where(resized, config.size_cost + config.size_spread_cost * log**2, 0.0)
    found = _judged(
        np.concatenate([T_cam_model, moved]),
        model,
        verifier,
        config,
        np.tile(scale, 2),
        np.tile(cost, 2),
    )
    return _distinct(found, config)


def by_colour(
    found: list[Hypothesis], verifier: Verifier, config: SearchConfig
) -> list[Hypothesis]:
    """The placements, best first. Where one that looks like the best in depth is more like the
    image in colour, it takes its place, and those that are turned otherwise go."""
    best = found[0]
    model, colour = best.model, config.colour
    if not colour.asked or not model.stored.record.get("coloured"):
        return found
    turns = np.concatenate(
        [
            as_transforms(turns_about_itself(colour.turns)),
            about_main_axes(model.surface, colour.turns, colour.main_axes),
        ]
    )
    T = best.T_cam_model @ turns
    score = coarse_score(T, model, verifier, config)
    T = brought_nearer(
        T[best_and_different(turns[:, :3, :3], score, config.middle, colour.apart)],
        model,
        verifier,
        config,
        config.middle_points,
        config.fine_distance,
        config.middle_steps,
    )
    T = different(T, config)
    # Where depth shows little, what lies otherwise may be as like it as what is turned.
    before = [best] if verifier.mask is None else found
    alike = [
        each
        for each in [*before, *_judged(T, model, verifier, config)]
        if each.alignment_score >= best.alignment_score - colour.alike
    ]
    both = [
        each.alignment_score
        + colour.worth
        * print_agreement(each.T_cam_model, model, verifier.frame, colour, verifier.lost)
        for each in alike
    ]
    chosen = int(np.argmax(both))
    if both[chosen] < both[0] + colour.gain:
        return found
    # Depth does not tell them apart: the score stays, and with it the order.
    right = replace(alike[chosen], alignment_score=best.alignment_score)
    turned = _rotation(right).inv()
    near = [each for each in found if (turned * _rotation(each)).magnitude() < colour.apart]
    return [right, *near]


def _rotation(placed: Hypothesis) -> Rotation:
    return Rotation.from_matrix(placed.T_cam_model[:3, :3] / placed.scale)


def different(T_cam_model: Array, config: SearchConfig) -> Array:
    """Placements (B, 4, 4), best first, of one size, without those that are all but a better one:
    more steps would bring both to the same place."""
    return without_same(T_cam_model, config.same_turn, config.same_shift)


def _distinct(found: list[Hypothesis], config: SearchConfig) -> list[Hypothesis]:
    """Without those whose surface lies within `config.distinct` metres, on average, of that of a
    better one: a ball turned about its middle is one hypothesis, not many."""
    kept: list[Hypothesis] = []
    for each in found:
        surface = transform_points(each.T_cam_model, each.model.surface[: config.model_points])
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


def _judged(
    T_cam_model: Array,
    model: Model,
    verifier: Verifier,
    config: SearchConfig,
    scale: Array | float = 1.0,
    cost: Array | float = 0.0,
) -> list[Hypothesis]:
    """Placements (B, 4, 4), verified, best first; `scale` (B,) of the model's size, and what that
    costs (B,)."""
    if not len(T_cam_model):
        return []
    score = verifier.score(
        T_cam_model,
        model,
        config.alignment_score,
        model_points=config.fine_points,
        seen_points=config.fine_points,
    )
    scales = np.broadcast_to(scale, score.shape)
    found = [
        Hypothesis(model, T, float(size), float(s))
        for T, size, s in zip(T_cam_model, scales, score - cost, strict=True)
    ]
    return sorted(found, key=lambda each: -each.alignment_score)


def _of_other_sizes(
    found: list[Hypothesis], model: Model, verifier: Verifier, config: SearchConfig
) -> list[Hypothesis]:
    """The best placements again as those of something of that kind, but of another size, which is
    refined with the pose. What comes out as large as the model is no other hypothesis."""
    parents = [each.T_cam_model for each in found[: config.rescaled]]
    T = np.stack([_resize(each, s, verifier) for each in parents for s in config.sizes])
    T_model_cam = inverses(T)
    seen = verifier.points[: config.middle_points]
    for resize in (True, False):
        T_model_cam = refine_to_sdf(
            T_model_cam, seen, model, config.size_distance, config.middle_steps, resize=resize
        )
    T = inverses(T_model_cam)
    log_size = np.log(np.cbrt(np.linalg.det(T[:, :3, :3])))
    other = (np.abs(log_size) > config.least_size_change) & (np.abs(log_size) < config.most_size)
    cost = config.size_cost + config.size_spread_cost * log_size**2
    return _judged(T[other], model, verifier, config, np.exp(log_size[other]), cost[other])


def _resize(T_cam_model: Array, scale: float, verifier: Verifier) -> Array:
    """Grown by `scale` about the middle of what is seen."""
    center = verifier.points.mean(axis=0)
    T = T_cam_model.copy()
    T[:3, :3] *= scale
    T[:3, 3] = center + scale * (T[:3, 3] - center)
    return T
