"""How well each of many models can be placed on what is seen: the search of pose_search.py, cut
short.

The search looks for the pose to within a millimetre. Here only the alignment score is asked for,
which tells models apart long before that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig
from brrp_cli.registration.initial_poses import resting_initial_poses
from brrp_cli.registration.model import ModelGeometry
from brrp_cli.registration.sdf_refinement import refine_to_sdf
from brrp_cli.registration.verification import Verifier

Array = NDArray[np.float64]


def alignment_scores(
    models: Sequence[ModelGeometry], verifier: Verifier, config: SearchConfig
) -> Array:
    """The alignment score (m,) that each model reaches, 1 at best, on a plane that `verifier` must
    have.

    All are refined coarsely; those that stay `beaten` behind the best of them are not refined
    further. Scores are compared with `seen_points` observed points, at last with `fine_points`.
    """
    rough = [_coarse(model, verifier, config) for model in models]
    score = np.array([reached for _, reached in rough])
    for i in np.flatnonzero(score >= score.max(initial=-np.inf) - config.beaten).tolist():
        T = _refined(
            rough[i][0],
            models[i],
            verifier,
            config.fine_points,
            config.fine_distance,
            config.fine_steps,
        )
        score[i] = _scores(T, models[i], verifier, config, config.fine_points).max()
    return score


def _coarse(model: ModelGeometry, verifier: Verifier, config: SearchConfig) -> tuple[Array, float]:
    """The `fine` best placements T_cam_model (B, 4, 4) after a coarse refinement, and the best
    score."""
    assert verifier.plane is not None
    T = np.stack(resting_initial_poses(model, verifier.points, verifier.plane, config))
    first = _scores(T, model, verifier, config, config.seen_points // config.first_share)
    T = T[np.argsort(-first, kind="stable")[: config.coarse]]
    T = _refined(
        T, model, verifier, config.coarse_points, config.coarse_distance, config.coarse_steps
    )
    score = _scores(T, model, verifier, config, config.seen_points)
    order = np.argsort(-score, kind="stable")[: config.fine]
    return np.asarray(T[order]), float(score[order[0]])


def _scores(
    T_cam_model: Array, model: ModelGeometry, verifier: Verifier, config: SearchConfig, points: int
) -> Array:
    return verifier.score(
        T_cam_model, model, config.alignment_score, model_points=points, seen_points=points
    )


def _refined(
    T_cam_model: Array,
    model: ModelGeometry,
    verifier: Verifier,
    points: int,
    distance: float,
    steps: int,
) -> Array:
    T_model_cam = np.asarray(np.linalg.inv(T_cam_model), dtype=np.float64)
    seen = verifier.points[:points]
    return np.asarray(np.linalg.inv(refine_to_sdf(T_model_cam, seen, model, distance, steps)))
