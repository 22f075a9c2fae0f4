"""Hypotheses that an object which the prior does not hold is like a stored one: fitted kin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, softmax

from brrp_cli.config import HypothesesConfig, KinConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.kin.evidence import Evidence, OtherDepth, gather
from brrp_cli.kin.fit import Fits, fit_kin
from brrp_cli.kin.kept_library import kin_library
from brrp_cli.kin.lengths import for_size
from brrp_cli.kin.library import Library
from brrp_cli.kin.opening import opening
from brrp_cli.kin.placement import distance_and_slopes
from brrp_cli.kin.stretched import BentShape, bent_shape, unbent_shape
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.store import Prior
from brrp_cli.seeds import child_rng

Array = NDArray[np.float64]


@dataclass(frozen=True)
class KinHypothesis:
    """share : of the weight of "none of the stored objects"; scales : (3,) over the stored shape,
    along the axes of its box in its resting pose, the last upright; walls : from 0, a solid, to 1,
    a hollow thing."""

    shape: PlacedShape
    share: float
    scales: tuple[float, float, float]
    walls: float


def kin_hypotheses(
    points: NDArray[np.float32],
    frame: Frame,
    object_id: int,
    plane: Plane | None,
    prior: Prior,
    config: HypothesesConfig,
    seed: int,
    others: Sequence[NDArray[np.floating]] = (),
    depths: Sequence[OtherDepth] = (),
    mixing: int = 0,
) -> list[KinHypothesis]:
    """The best fits that differ, whose shares leave to the completion what speaks against them.

    points : (n, 3) observed, metres, camera frame. None where shapes have no plane to stand on, and
    where no fit is convincing. others : the same of other views of it, and `depths` of
    these; mixing : pixels over which the camera mixes both sides of a jump of depth
    """
    kin = config.kin
    if plane is None or not kin.enabled:
        return []
    rng = child_rng(seed, "kin", object_id)
    evidence = gather(points, frame, object_id, plane, kin, config.sensor, rng, others, depths)
    if len(evidence.seen) < kin.least_seen:
        return []
    library = kin_library(prior, kin)
    kin = for_size(kin, evidence.seen)
    fits = fit_kin(evidence, library, kin)
    rows = _distinct(fits, library, kin)
    hollow = library.hollow[fits.placements.stance[rows]]
    into = opening(evidence.seen, evidence.eye, kin.opening_share)
    shares = kin_shares(fits.score[rows], hollow, len(evidence.seen), into, kin)
    chosen = rows[shares >= kin.least_share]
    if not len(chosen):
        return []
    names = [library.names[library.object[fits.placements.stance[row]]] for row in chosen]
    found = [
        bent_shape(
            unbent_shape(fits.placements, int(row), prior.load(name).shape, library),
            evidence,
            kin,
            rng,
        )
        for row, name in zip(chosen, names, strict=True)
    ]
    together = shares[shares >= kin.least_share].sum()
    cost = np.array([each.cost for each in found])
    hollow = library.hollow[fits.placements.stance[chosen]]
    most = most_through(cost, hollow, into if mixing else 0.0, kin)
    kept = [k for k, each in enumerate(found) if each.through <= most[k]]
    if not kept:
        return []
    chosen, names, found = chosen[kept], [names[k] for k in kept], [found[k] for k in kept]
    cost, hollow = cost[kept], hollow[kept]
    relative = bent_shares(cost, hollow, into, kin)
    return [
        _hypothesis(name, each, float(share), float(walls), evidence, config)
        for name, each, share, walls in zip(
            names, found, together * relative, _walls(hollow, kin), strict=True
        )
        if share >= kin.least_share
    ]


def beside_round(like: Sequence[KinHypothesis], config: KinConfig) -> list[KinHypothesis]:
    """What is left of kin where the completion knows that the object is round: it is better than
    all that is solid then, and lacks walls that were not seen."""
    left = [replace(each, share=each.share * each.walls) for each in like]
    return [each for each in left if each.share >= config.least_share]


def kin_shares(
    score: NDArray[np.floating],
    hollow: NDArray[np.floating],
    seen: int,
    into: float,
    config: KinConfig,
) -> Array:
    """Shares (k,) of fits with scores (k,), best first: that of all of them follows from the best
    one's, that of each from its distance to it.

    hollow : (k,) of each shape; the completion is worse at walls than at solids
    seen : observed points; of few of them nothing is certain
    into : how far the camera looks into the object; of what is open to it, a hollow shape is right
        even where its form is not quite
    """
    if not len(score):
        return np.zeros(0)
    walls = float(_walls(hollow[:1], config)[0])
    low, high = config.opening
    bonus = np.interp(into, [low, high], [config.hollow_bonus, config.opening_bonus])
    gained = float(score[0]) + float(bonus) * walls - config.convincing
    together = expit(config.sharpness * gained)
    together *= config.solid_most + (1 - config.solid_most) * walls
    together *= min(1.0, seen / config.many_seen)
    relative = np.exp(config.sharpness * (score.astype(np.float64) - float(score[0])))
    return np.asarray(together * relative / relative.sum())


def bent_shares(
    cost: NDArray[np.floating], hollow: NDArray[np.floating], into: float, config: KinConfig
) -> Array:
    """Shares (k,) of what `kin_shares` gives them all, of fits with these costs (k,) once bent.

    hollow, into : as in `kin_shares`; a solid has to fit best, since the completion is good at
    solids, and a hollow thing that the camera looks into least
    """
    best = int(np.argmin(cost))
    walls = float(_walls(hollow[[best]], config)[0])
    closed, wall, opened = np.log(config.most_cost)
    most = closed + walls * (np.interp(into, config.opening, [wall, opened]) - closed)
    together = expit(config.cost_sharpness * (most - np.log(cost[best])))
    relative = softmax(-config.sharpness * cost)
    relative = np.where(relative >= config.least_share, relative, 0)
    return np.asarray(together * relative / relative.sum())


def most_through(
    cost: NDArray[np.floating], hollow: NDArray[np.floating], into: float, config: KinConfig
) -> Array:
    """The shares (k,) of the surface of bent shapes that may stand before what was measured.

    cost, hollow : (k,) of each; into : how far a camera that mixes depths looks into the object.
    Its depth may run from the floor of a bowl to the table as if no wall were between. The rest of
    the bowl fits well: a shape that does not is another one.
    """
    closed, opened = config.most_through
    looked = np.interp(into, config.opening, [0, 1]) * (cost <= config.most_cost[1])
    return np.asarray(closed + (opened - closed) * looked * _walls(hollow, config))


def _walls(hollow: NDArray[np.floating], config: KinConfig) -> Array:
    """(k,) from 0, a solid, to 1, a hollow thing, of shares of hollow space."""
    low, high = config.hollow
    return np.clip((np.asarray(hollow, np.float64) - low) / (high - low), 0, 1)


def _distinct(fits: Fits, library: Library, config: KinConfig) -> NDArray[np.int64]:
    """Rows of the best fits whose surfaces lie at least `config.distinct` metres apart, on
    average."""
    kept: list[int] = []
    surfaces = fits.placements.placed(library.surface[fits.placements.stance])
    for row in range(len(fits.score)):
        points = surfaces[:, row, :: config.distinct_step].T
        if kept:
            known = fits.placements[np.array(kept)]
            distance = distance_and_slopes(known, points, library)[0]
            if np.abs(distance).mean(axis=1).min() < config.distinct:
                continue
        kept.append(row)
        if len(kept) == config.hypotheses:
            break
    return np.array(kept, np.int64)


def _hypothesis(
    name: str,
    bent: BentShape,
    share: float,
    walls: float,
    evidence: Evidence,
    config: HypothesesConfig,
) -> KinHypothesis:
    """walls : from 0, a solid, to 1, a hollow thing"""
    kin = config.kin
    shape = bent.shape(kin)
    off = shape.distance(transform_points(np.linalg.inv(bent.T_plane_shape), evidence.seen))
    near = np.exp(-0.5 * np.square(off) / (kin.near**2 + evidence.noise**2)).mean()
    placed = PlacedShape(
        name,
        shape,
        evidence.T_cam_plane @ bent.T_plane_shape,
        kin.width + kin.doubt * max(0.0, kin.sure - float(near)),
        config.mean.limit,
        # How far the shape is off says its width; the place is part of it.
        np.zeros((6, 6)),
        kin=True,
        exact=kin.exact if walls > 0 else 0.0,
    )
    x, y, z = (float(s) for s in bent.fit.half / bent.fit.stored_half)
    return KinHypothesis(placed, share, (x, y, z), walls)
