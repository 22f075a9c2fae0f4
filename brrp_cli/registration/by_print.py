"""A placed object turned as what is printed on it lies in the image.

Depth leaves a can free to turn about its axis, and a ball about any. The search tells a front from
a back by turns that are far apart; here the print says how the object is turned to a degree or two,
and only that: what depth fixes stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig
from brrp_cli.config.turns import PrintConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.registration.model import Model
from brrp_cli.registration.onto_itself import turns_onto_itself
from brrp_cli.registration.point_distances import distances, worse_than
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.print_agreement import agreement, how_printed
from brrp_cli.registration.turns import best_and_different, motions
from brrp_cli.registration.views import Views

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def turned_by_print(
    placed: Hypothesis,
    views: Views,
    patch: float,
    config: SearchConfig,
    judge: Callable[[Array], float],
    refine: Callable[[Hypothesis], Hypothesis],
    covariance: Callable[[Array], Array],
) -> Hypothesis:
    """`placed`, turned in directions that depth leaves open as its print lies in the image; or
    turned onto itself, where print and depth together say so.

    patch : metres; pixels within one err together and are one vote
    judge : log likelihood ratio, nats, of a placement T_cam_model (4, 4), without its print
    refine : brings a placement as near as `placed` came, which takes its time
    covariance : (6, 6) of a placement's turn, radians, and shift, metres, by what depth says
    """
    model, own = placed.model, config.by_print
    if not own.asked or not model.stored.record.get("coloured"):
        return placed

    def nats(T: Array) -> Array:
        return joint_print_nats(T, model, views, config)

    def nearer(each: Hypothesis) -> tuple[Hypothesis, float]:
        T = each.T_cam_model
        T, printed = _followed(T, *_open(T, model, covariance(T), own), nats, own)
        return replace(each, T_cam_model=T), printed

    start = turns_onto_itself(model, config.about_itself)
    every = np.concatenate([placed.T_cam_model[None], placed.T_cam_model @ start])
    printed = nats(every)
    if printed.max() <= 0:
        return placed
    best = _Judged(placed, float(printed[0]), judge)

    def better(each: _Judged, gain: float) -> bool:
        depth = _speaks_for(each.placed, best.placed, views, patch, config)
        return each.printed - best.printed + each.otherwise - best.otherwise + depth > gain

    moved = _Judged(*nearer(placed), judge)
    if moved.printed > best.printed and better(moved, 0.0):
        best = moved
    for row in best_and_different(start[:, :3, :3], printed[1:], own.tried, own.apart):
        if printed[1 + row] < best.printed - own.behind:
            continue
        other, more = nearer(replace(placed, T_cam_model=every[1 + row]))
        if more < best.printed + own.least:
            continue
        turned = _Judged(*nearer(refine(other)), judge)
        if better(turned, own.gain):
            best = turned
    return best.placed


@dataclass(frozen=True)
class _Judged:
    """A placement, the nats of its print, and what judges the rest, which takes its time."""

    placed: Hypothesis
    printed: float
    judge: Callable[[Array], float]

    @cached_property
    def otherwise(self) -> float:
        """Log likelihood ratio, nats, without the print."""
        return self.judge(self.placed.T_cam_model)


def _speaks_for(
    one: Hypothesis, other: Hypothesis, views: Views, patch: float, config: SearchConfig
) -> float:
    """Nats by which the distances of observed points speak for one placement and against the other
    one; less than 0 where they speak against it."""
    turn = config.about_itself
    points = views.points[: turn.points]
    both = np.stack([other.T_cam_model, one.T_cam_model])
    exact = np.minimum(distances(both, one, points, exact=True), turn.far)
    (_, worse), (_, doubt) = worse_than(0, exact, points, patch, turn.exact)
    errors = worse / doubt
    return float(-0.5 * errors * abs(errors))


def joint_print_nats(T_cam_model: Array, model: Model, views: Views, config: SearchConfig) -> Array:
    """(B,) `print_nats` of placements (B, 4, 4) in all views; 0 of a model without colours."""
    if not model.stored.record.get("coloured"):
        return np.zeros(len(T_cam_model))
    return views.joint(
        lambda view: print_nats(
            view.T_view_cam @ T_cam_model, model, view.seen.frame, config, view.seen.lost
        )
    )


def print_nats(
    T_cam_model: Array, model: Model, frame: Frame, config: SearchConfig, lost: Mask | None
) -> Array:
    """(B,) nats by which the image's colours are more probable where they follow from the stored
    ones, by a line through both, than where they do not: -n/2 ln(1 - correlation^2) of n votes.
    None speak for colours that are reversed."""
    own = config.by_print
    found = agreement(T_cam_model, model, frame, config.colour, own.cell, own.vertices, lost)
    square = np.clip(found.correlation, 0.0, own.most_alike) ** 2
    votes = own.independent * found.cells * how_printed(found, config.colour)
    return np.asarray(-0.5 * votes * np.log(1 - square))


def _open(
    T_cam_model: Array, model: Model, covariance: Array, config: PrintConfig
) -> tuple[Array, Array]:
    """Motions (6, D) of unit length, metres on the surface, that depth leaves open, as turn and
    shift; and the standard deviation (D,), metres, that it leaves them."""
    scale = np.cbrt(np.linalg.det(T_cam_model[:3, :3]))
    radius = float(np.sqrt((model.surface**2).sum(axis=1).mean())) * scale
    size = np.diag([radius] * 3 + [1.0] * 3)
    square, along = np.linalg.eigh(size @ covariance @ size)
    wide = square > config.open**2
    return np.linalg.inv(size) @ along[:, wide], np.sqrt(square[wide])


def _followed(
    T_cam_model: Array,
    along: Array,
    deviation: Array,
    nats: Callable[[Array], Array],
    config: PrintConfig,
) -> tuple[Array, float]:
    """The placement moved `along` (6, D), whose standard deviation (D,) is what depth leaves, as
    far as `nats` of placements (B, 4, 4) gain by it, and its nats: a search by steps that are
    halved where none of them gains."""
    if not along.shape[1]:
        return T_cam_model, float(nats(T_cam_model[None])[0])
    axes = np.concatenate([np.eye(len(deviation)), -np.eye(len(deviation))])

    def worth(moves: Array) -> Array:
        T = motions(moves @ along.T, T_cam_model[:3, 3]) @ T_cam_model
        return np.asarray(nats(T) - 0.5 * ((moves / deviation) ** 2).sum(axis=1))

    at, step = np.zeros(len(deviation)), config.first_step
    best = float(worth(at[None])[0])
    while step >= config.last_step:
        tried = at + step * axes
        gained = worth(tried)
        row = int(gained.argmax())
        if gained[row] > best:
            at, best = tried[row], float(gained[row])
        else:
            step /= 2
    found = motions((along @ at)[None], T_cam_model[:3, 3]) @ T_cam_model
    return np.asarray(found[0]), float(nats(found)[0])
