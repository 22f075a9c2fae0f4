"""Weights of placements, and of "none of the stored objects", from likelihoods and P(c|R)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import HypothesesConfig, WeighConfig
from brrp_cli.registration.likelihood import SeenPixels, evidence, log_likelihood
from brrp_cli.registration.model import Model
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.views import SeenFrom, Views

Array = NDArray[np.float64]


def counted_once(config: HypothesesConfig, knows_depth: bool) -> HypothesesConfig:
    """With less of depth residuals where P(c|R) follows from depth already."""
    if not knows_depth:
        return config
    likelihood = config.likelihood
    return replace(config, likelihood=replace(likelihood, depth=likelihood.known_depth))


def judged(
    placed: list[Hypothesis],
    seen: SeenPixels,
    config: HypothesesConfig,
    refined: Callable[[Hypothesis], Hypothesis],
) -> tuple[list[Hypothesis], list[float]]:
    """Placements and the log likelihood ratio of each, nats, against that it is none of the stored
    objects; where that may decide, the best of each stored object is `refined` first.

    The search is right to a millimetre, and a shape that is nearly the right one is no further off.
    """
    likelihood = config.likelihood
    best = max((each.alignment_score for each in placed), default=-np.inf)
    least = max(best - likelihood.within, likelihood.least_alignment)

    def ratio(each: Hypothesis) -> float:
        if each.alignment_score < least:
            return -np.inf
        found = evidence(each.T_cam_model, each.model, seen, likelihood, config.search.colour)
        return log_likelihood(found, likelihood) - other_size(each, config)

    placed, ratios = list(placed), [ratio(each) for each in placed]
    for name, most in best_ratios(placed, ratios).items():
        if most > likelihood.refined_from:
            i = next(
                i
                for i, each in enumerate(placed)
                if each.model.stored.name == name and ratios[i] == most
            )
            placed[i] = refined(placed[i])
            ratios[i] = ratio(placed[i])
    return placed, ratios


def joint_log_likelihood(
    T_cam_model: Array,
    model: Model,
    views: Views,
    config: HypothesesConfig,
    *,
    asks_colour: bool = True,
) -> float:
    """Of a placement T_cam_model (4, 4), against that it is none of the stored objects, nats, in
    all views of it; with its print or without."""
    likelihood, colour = config.likelihood, config.search.colour

    def ratio(view: SeenFrom) -> float:
        T_view_model = view.T_view_cam @ T_cam_model
        found = evidence(T_view_model, model, view.seen, likelihood, colour)
        return log_likelihood(found if asks_colour else replace(found, colour=0.0), likelihood)

    return float(views.joint(ratio))


def other_size(placed: Hypothesis, config: HypothesesConfig) -> float:
    """Nats against a placement whose size is not the stored one's."""
    resized = abs(np.log(placed.scale)) > config.search.least_size_change
    return config.likelihood.other_size * float(resized)


def best_ratios(placed: Sequence[Hypothesis], ratios: Sequence[float]) -> dict[str, float]:
    """Name -> log likelihood ratio, nats, of the best placement of each object."""
    best: dict[str, float] = {}
    for each, ratio in zip(placed, ratios, strict=True):
        name = each.model.stored.name
        best[name] = max(float(ratio), best.get(name, -np.inf))
    return best


def piece_doubt(pixels: int, config: WeighConfig) -> float:
    """Nats for "none of them", in a mask of so many pixels that brrp made: a small one may be a
    piece of an object, and pieces look like many objects."""
    return config.doubt * max(0.0, float(np.log(config.small / max(pixels, 1))))


def weigh(
    shares: Sequence[float],
    log_ratios: Sequence[float],
    missing: float,
    config: WeighConfig,
    doubt: float = 0.0,
) -> Array:
    """Weights (C + 1,), sum 1, of C hypotheses and, last, of the one that it is something else.

    shares : P(c|R) of each hypothesis's object; log_ratios : how much more probable each makes the
    frame than the last one does, nats; missing : P(none of these objects | R); doubt : nats by
    which the last one is more probable than that.
    """
    none = float(np.clip(missing, config.least_unknown, config.most_unknown))
    known = np.asarray(shares, dtype=np.float64)
    # Ratios among the stored objects are the retriever's, how likely they are as a whole is not:
    # a likelihood that is above all doubt outweighs a retriever that was wrong.
    if not known.any():
        known = np.ones_like(known)
    probability = np.append(known / (known.sum() or 1.0) * (1 - none), none)
    ratios = np.append(np.asarray(log_ratios, dtype=np.float64), doubt)
    log = np.log(np.maximum(probability, config.least_share)) + ratios
    weights = np.exp(log - log.max())
    return np.asarray(weights / weights.sum())
