"""Placements of one object that differ by a turn under which it looks almost alike.

A ball, a fruit or a cup is almost the same however it is turned about itself. The search keeps one
placement of those whose surfaces lie together. Which of them is right, the pixels tell at most by
fractions of a millimetre, over the whole of what is seen: here they are compared pixel by pixel,
and what they cannot decide is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig, TurnConfig
from brrp_cli.registration.onto_itself import turned_by, turns_onto_itself
from brrp_cli.registration.point_distances import distances, worse_than
from brrp_cli.registration.pose_search import Hypothesis, different
from brrp_cli.registration.sdf_refinement import refine_to_sdf
from brrp_cli.registration.transform_loops import inverses
from brrp_cli.registration.turns import best_and_different
from brrp_cli.registration.verification import Verifier
from brrp_cli.registration.views import Views

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Turned:
    """best : the most probable placement, refined; alike : (K, 4, 4) T_cam_model of others, turned
    otherwise, that what was seen does not tell apart from it"""

    best: Hypothesis
    alike: Array


def turned(
    placed: Hypothesis,
    verifier: Verifier,
    views: Views,
    patch: float,
    config: SearchConfig,
    judge: Callable[[Array], float],
    refine: Callable[[Hypothesis], Hypothesis],
    steady: float = 0.0,
) -> Turned:
    """`placed`, or turned about itself where that is more probable; and what is nearly as probable.

    patch : metres; pixels within one err together and are one vote
    judge : log likelihood ratio, nats, of a placement T_cam_model (4, 4), in all views
    refine : brings a placement as near as `placed` came, which takes its time
    steady : nats by which another one has to be more probable to take the place of `placed`
    """
    turn = config.about_itself
    start = turns_onto_itself(placed.model, turn)
    if not len(start):
        return Turned(placed, np.empty((0, 4, 4)))
    points = views.points[: turn.points]
    T = placed.T_cam_model @ start
    coarse = np.minimum(distances(T, placed, points[: turn.coarse_points]), turn.far).mean(axis=1)
    T = T[best_and_different(start[:, :3, :3], -coarse, turn.count, turn.apart)]
    refined = refine_to_sdf(
        inverses(T),
        points[: config.fine_points],
        placed.model,
        config.fine_distance,
        config.middle_steps,
    )
    T = inverses(refined)
    near = np.minimum(distances(T, placed, points[: config.fine_points]), turn.far).mean(axis=1)
    near_enough = np.argsort(near, kind="stable")[: turn.judged]
    T = different(T[near_enough[near[near_enough] <= near.min() + turn.worse]], config)
    T = np.concatenate([placed.T_cam_model[None], T])
    T = T[_as_much_explained(T, placed, verifier, config)]
    if len(T) == 1:
        return Turned(placed, np.empty((0, 4, 4)))
    exact = np.minimum(distances(T, placed, points, exact=True), turn.far)
    worse, doubt = worse_than(0, exact, points, patch, turn.exact)
    first = int(np.argmin(worse + turn.gain * doubt))
    # As near as `placed`, which those that are refined would beat unfairly otherwise.
    best = placed if first == 0 else refine(replace(placed, T_cam_model=T[first]))
    if first and judge(best.T_cam_model) < judge(placed.T_cam_model) + steady:
        first, best = 0, placed
    worse, doubt = worse_than(first, exact, points, patch, turn.exact)
    undecided = (worse <= turn.undecided * doubt) & (turned_by(T, T[first]) >= turn.apart)
    if not undecided.any():
        return Turned(best, np.empty((0, 4, 4)))
    own = judge(best.T_cam_model)
    others = [replace(best, T_cam_model=each) for each in T[undecided]]
    found = [(own, best), *_as_probable(others, own - turn.nats, turn, judge, refine)]
    # The first of those that are equal.
    most = max(range(len(found)), key=lambda row: found[row][0])
    most = most if found[most][0] >= own + steady else 0
    _, chosen = found.pop(most)
    best = best if most == 0 else refine(chosen)
    return Turned(best, np.array([each.T_cam_model for _, each in found]).reshape(-1, 4, 4))


def _as_probable(
    placed: Sequence[Hypothesis],
    least: float,
    config: TurnConfig,
    judge: Callable[[Array], float],
    refine: Callable[[Hypothesis], Hypothesis],
) -> list[tuple[float, Hypothesis]]:
    """Log likelihood ratio, nats, and placement of those for which it is `least` or more. What is
    not far below it is refined first: half a degree by which it is off may cost so much."""
    found = [(judge(each.T_cam_model), each) for each in placed]
    below = [row for row, (ratio, _) in enumerate(found) if ratio < least]
    below.sort(key=lambda row: -found[row][0])
    for row in below[: config.refined]:
        if found[row][0] >= least - config.refined_nats:
            nearer = refine(found[row][1])
            found[row] = judge(nearer.T_cam_model), nearer
    return [each for each in found if each[0] >= least]


def _as_much_explained(
    T: Array, placed: Hypothesis, verifier: Verifier, config: SearchConfig
) -> NDArray[np.bool_]:
    """(K,) whether free space and the table speak no more against each placement than against the
    first."""
    score = verifier.score(
        T,
        placed.model,
        config.alignment_score,
        model_points=config.fine_points,
        seen_points=config.fine_points,
    )
    return np.asarray(score >= score[0] - config.about_itself.alike)
