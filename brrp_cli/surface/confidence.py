"""The surface inside which an object lies with a given probability.

A posterior tells for each point how probably it is occupied. Of the whole shape O it says this:
particle i is drawn with the probability of its share, a level u uniformly from (0, 1), and

    O = {x : p_i(x) > u}.

So every point is occupied with the posterior's p(x) = mean_i p_i(x). Within a particle the surface
lies further out or further in as a whole; from particle to particle it differs as they differ. The
region that is sought is the smallest of

    C_t = {x : p(x) >= t}    with    P(O in C_t) = 1 - mean_i sup {p_i(x) : p(x) < t} >= confidence,

a statement about all of O at once. It is never smaller than {p >= 1 - confidence}, which holds for
each point alone, and is the same where there is one particle. Nested level sets of p as candidates
and a joint probability to choose among them: Bolin and Lindgren, "Excursion and contour uncertainty
regions for latent Gaussian models", JRSS B 77 (2015), section 2.

Of a recognised object the place is in doubt, and not the shape. There the region is a band around
its mesh, as wide at each vertex as its standard deviation times one factor: the smallest that holds
all vertices at once with the given probability when the pose is drawn from its covariance (a
simultaneous confidence band), and what the stored mesh itself may be off. Where the object may as
well be turned about itself, the band reaches as far as those placements do.

The posterior is what it is: where it is too sure, so is C_t, and of what no stored object explains
it is. What all hypotheses have wrong none of them tells, and that grows with the way to what was
seen. There the region goes beyond C_t by what such shapes were found to be off (around_guess.py).

A margin d grows any region beyond it, into
{x outside of C_t : distance to C_t <= d and x was not seen to be empty}.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from brrp_cli.config import SurfaceConfig
from brrp_cli.geometry import grid_nodes
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.particles import particle_shares, particle_volumes
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.reconstruction import Axes, OccupancyPosterior
from brrp_cli.seeds import child_rng
from brrp_cli.surface.around_guess import Free, grown_by_guess, widened
from brrp_cli.surface.around_mesh import (
    around_axes,
    beyond_reach,
    marching_cubes_of,
    out_to_reach,
    reach_of_alike,
)
from brrp_cli.surface.extract import grid_axes, level_set
from brrp_cli.surface.stored_mesh import along_normals, moved_to_level, placed

# Which of points (n, 3), metres, camera frame, were seen to be empty: (n,) bool.
Empty = Callable[[NDArray[np.float64]], NDArray[np.bool_]]


@dataclass(frozen=True)
class ConfidenceSurface:
    """A closed, outward mesh that the object lies inside of with probability `confidence`.

    vertices : (n, 3) float64, metres, camera frame; faces : (m, 3) int64
    level : t, the occupancy probability on it; around a recognised object's mesh, whose place and
    not whose shape is in doubt, 1 - confidence
    bounded : false where the region reaches the end of what the posterior describes, so that
    the object may go on beyond it
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    confidence: float
    level: float
    bounded: bool


def confidence_level(
    volumes: NDArray[np.floating], confidence: float, shares: NDArray[np.float64] | None = None
) -> float | None:
    """The largest t at which P(O in C_t) >= confidence; None where even "O is empty" is that
    probable.

    volumes : (P, ...) occupancy of each particle at the points of a grid; confidence : in (0, 1);
    shares : (P,), sum 1, the weight of each particle; None: all weigh the same
    """
    particles = volumes.reshape(len(volumes), -1)
    shares = np.full(len(volumes), 1 / len(volumes)) if shares is None else shares
    mean = shares @ particles
    order = np.argsort(mean, kind="stable")
    # P(O not in C) when the first k points are outside of C.
    missed = shares @ np.maximum.accumulate(particles[:, order], axis=1)
    left_out = int(np.searchsorted(missed, 1 - confidence, side="right"))
    return None if left_out == len(mean) else float(mean[order[left_out]])


def confidence_surface(
    posterior: OccupancyPosterior,
    observed: NDArray[np.floating],
    confidence: float,
    config: SurfaceConfig,
    margin: float = 0.0,
    empty: Empty | None = None,
    free: Free | None = None,
) -> ConfidenceSurface | None:
    """The boundary of the smallest C_t that holds the object with probability `confidence`.

    observed : (n, 3) points of the object, metres, camera frame. As with the mesh, parts that no
    observed point is near are dropped. None where nothing is left.
    margin : metres by which C_t is grown where `empty` does not forbid it
    free : where a ball was seen to be empty; with it, what is guessed is grown by as much as such
    guesses were found to be off. A method that has one guess and no hypotheses is taken at its word
    """
    if isinstance(posterior, HypothesisPosterior) and posterior.dominant is not None:
        around = _around_stored_mesh(
            posterior, posterior.dominant, confidence, config, margin, empty
        )
        if around is not None:
            return around
    axes = grid_axes(posterior.bounds, config.spacing)
    volumes = particle_volumes(posterior, axes)
    shares = particle_shares(posterior, len(volumes))
    level = confidence_level(volumes, confidence, shares)
    if level is None:
        return None
    # The mesh is the best guess, at whatever level: it lies inside in any case.
    level = min(level, config.level)
    mean = np.tensordot(shares, volumes, axes=1)
    found = level_set(mean, axes, observed, level, config)
    bounded = not _at_edge(mean >= level)
    guessed = isinstance(posterior, HypothesisPosterior)
    if found is not None and ((guessed and free is not None) or margin > 0):
        # In units of the level, so that the surface of C_t stays where it may not grow.
        region = mean / level
        if guessed and free is not None:
            region, axes = grown_by_guess(region, axes, observed, free, config)
            # What was observed is the object's, in as many pieces as it was seen.
            config = replace(config, one_piece=False)
        if margin > 0:
            region, axes = _grown(region, axes, margin, config.spacing, empty)
        found = level_set(region, axes, observed, 1.0, config)
    if found is None:
        return None
    return ConfidenceSurface(found.vertices, found.faces, confidence, level, bounded)


def _around_stored_mesh(
    posterior: HypothesisPosterior,
    number: int,
    confidence: float,
    config: SurfaceConfig,
    margin: float,
    empty: Empty | None,
) -> ConfidenceSurface | None:
    """The same around a recognised object's mesh; None where the frame contradicts the stored
    shape, and of kin, whose shape is in doubt."""
    if placed(posterior, number).kin:
        return None
    through = along_normals(posterior, number, config)
    best = moved_to_level(through, config.level, through.own)
    if best.off > config.most_off:
        return None
    shape = placed(posterior, number)
    by_pose = config.pose_share * simultaneous(shape, confidence, config) * shape.deviations
    band = np.hypot(by_pose, ndtri((1 + confidence) / 2) * config.fidelity)
    moved = np.einsum("ni,ni->n", best.vertices - through.vertices, through.normals)
    # Where a vertex is a corner, its faces move by less than itself.
    corners = band * shape.shape.corners
    # Both the placed mesh and the written one lie inside.
    reach = np.maximum(moved, 0.0) + corners + reach_of_alike(shape, config)
    axes = around_axes(shape, float(reach.max()) + margin, config)
    beyond = beyond_reach(shape, reach, axes, margin)
    if margin > 0:
        beyond = _less_margin(beyond, axes, margin, empty)
    inside: NDArray[np.floating] = -beyond
    if posterior.object_weight(number) < confidence:
        # The object may be something else altogether.
        level = confidence_level(through.particles, confidence, posterior.shares)
        if level is None:
            return None
        occupied = posterior.probability_volume(axes) / min(level, config.level) - 1
        inside = np.maximum(inside, occupied * (axes[0][1] - axes[0][0]))
    vertices, faces = marching_cubes_of(inside, axes)
    vertices = out_to_reach(shape, vertices, reach)
    return ConfidenceSurface(vertices, faces, confidence, 1 - confidence, bounded=True)


def simultaneous(shape: PlacedShape, confidence: float, config: SurfaceConfig) -> float:
    """How many standard deviations a band around the shape reaches outwards that holds its whole
    surface, moved by a draw from the covariance of its pose, with the given probability."""
    rows = shape.motion_rows[:: max(1, len(shape.normals) // config.band_vertices)]
    values, vectors = np.linalg.eigh(shape.covariance)
    along = rows @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    deviations = np.linalg.norm(along, axis=1)
    along = along[deviations > 0] / deviations[deviations > 0, None]
    if not len(along):
        return 0.0
    draws = child_rng(0, "simultaneous band").standard_normal((6, config.band_draws))
    return float(np.quantile((along @ draws).max(axis=0), confidence))


def _less_margin(
    beyond: NDArray[np.float64], axes: Axes, margin: float, empty: Empty | None
) -> NDArray[np.float64]:
    """Metres beyond a region that is wider by `margin` where it was not seen to be `empty`."""
    may_grow = (beyond > 0) & (beyond < 2 * margin)
    if empty is not None:
        nodes = grid_nodes(axes).astype(np.float64)
        may_grow[may_grow] = ~empty(nodes[may_grow])
    return np.where(may_grow, beyond - margin, beyond)


def _at_edge(region: NDArray[np.bool_]) -> bool:
    """Whether a region (nx, ny, nz) reaches an outermost node of its grid."""
    inner = np.zeros_like(region)
    inner[1:-1, 1:-1, 1:-1] = True
    return bool((region & ~inner).any())


def _grown(
    volume: NDArray[np.floating],
    axes: Axes,
    margin: float,
    spacing: float,
    empty: Empty | None,
) -> tuple[NDArray[np.float64], Axes]:
    """A volume on a grid that is wider by `margin`, at least 1 within `margin` of where the
    given one is; nodes that are `empty` keep their value."""
    from scipy.ndimage import distance_transform_edt

    volume, axes = widened(volume, axes, margin)
    distance = distance_transform_edt(volume < 1) * spacing
    may_grow = (distance > 0) & (distance < margin + spacing)
    if empty is not None:
        nodes = grid_nodes(axes)
        may_grow[may_grow] = ~empty(nodes[may_grow])
    grown = np.where(may_grow, np.maximum(volume, 1 + (margin - distance) / spacing), volume)
    return grown, axes
