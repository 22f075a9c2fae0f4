"""How well each of many models can be placed on what is seen: the search of pose_search.py, cut
short.

The search looks for the pose to within a millimetre. Here only the alignment score is asked for,
which tells models apart long before that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig
from brrp_cli.registration.begin import best_brought_nearer, best_of, brought_nearer
from brrp_cli.registration.leaning_poses import resting_and_leaning
from brrp_cli.registration.model import ModelGeometry
from brrp_cli.registration.verification import Verifier

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Aligned:
    """T_cam_model (B, 4, 4), placements of a model, best first, and their scores (B,), 1 at
    best."""

    T_cam_model: Array
    scores: Array

    @property
    def score(self) -> float:
        """That of the first placement."""
        return float(self.scores[0])

    def first(self, count: int) -> Aligned:
        """So many of them."""
        return Aligned(self.T_cam_model[:count], self.scores[:count])

    def after(self, count: int) -> Aligned:
        """Those after so many."""
        return Aligned(self.T_cam_model[count:], self.scores[count:])

    def followed_by(self, others: Aligned) -> Aligned:
        """These, and others after them."""
        return Aligned(
            np.concatenate([self.T_cam_model, others.T_cam_model]),
            np.concatenate([self.scores, others.scores]),
        )

    def ordered(self, values: Array) -> Aligned:
        """The first (n,) placements, those with the largest values (n,) first."""
        order = np.argsort(-values, kind="stable")
        return Aligned(np.asarray(self.T_cam_model[order]), self.scores[order])


def aligned(
    models: Sequence[ModelGeometry],
    placements: Sequence[Aligned],
    verifier: Verifier,
    config: SearchConfig,
    ordered: Callable[[Aligned, Any], Aligned] | None = None,
) -> list[Aligned]:
    """How well each model can be placed, from its first placements.

    All are refined coarsely; those that stay `beaten` behind the best of them are not refined
    further. Scores are compared with `seen_points` observed points, at last with `fine_points`.

    ordered : puts placements of a model in another order than that of their scores
    """
    order = ordered or (lambda placed, model: placed)
    found = [
        order(_coarse(model, first, verifier, config), model)
        for model, first in zip(models, placements, strict=True)
    ]
    best = max((each.score for each in found), default=-np.inf)
    return [
        order(finely(each, model, verifier, config), model)
        if each.score >= best - config.beaten
        else each
        for each, model in zip(found, models, strict=True)
    ]


def finely(
    placed: Aligned, model: ModelGeometry, verifier: Verifier, config: SearchConfig
) -> Aligned:
    """The `fine` best placements, refined with `fine_points`."""
    points = config.fine_points
    T = brought_nearer(
        placed.T_cam_model[: config.fine],
        model,
        verifier,
        config,
        points,
        config.fine_distance,
        config.fine_steps,
    )
    score = verifier.score(
        T, model, config.alignment_score, model_points=points, seen_points=points
    )
    return Aligned(T, score).ordered(score)


def first_placements(model: ModelGeometry, verifier: Verifier, config: SearchConfig) -> Aligned:
    """The `coarse` best of all ways to lay a model over what is seen, brought nearer: resting,
    raised, leaning.

    Where they begin tells little: of 299 true objects one in three begins within 0.1 of the score
    that it can reach.
    """
    T = resting_and_leaning(model, verifier.outline(config), config)
    return Aligned(*best_brought_nearer(T, model, verifier, config))


def _coarse(
    model: ModelGeometry, first: Aligned, verifier: Verifier, config: SearchConfig
) -> Aligned:
    """The first placements after a coarse refinement."""
    T = brought_nearer(
        first.T_cam_model,
        model,
        verifier,
        config,
        config.coarse_points,
        config.coarse_distance,
        config.coarse_steps,
    )
    return Aligned(*best_of(T, model, verifier, config, len(T)))
