"""The mesh of a recognised object: the stored one, moved along its normals to a level set of the
posterior.

Its topology, its sharp edges and its thin walls survive, which a grid would lose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.config.inference import SpreadConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior, MeanFunction, deviation
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.inference.posterior import LOGISTIC_DEVIATION, occupancy

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AlongNormals:
    """Occupancy on the way through the surface of a placed shape, along its vertices' normals.

    vertices, normals : (n, 3), metres, camera frame; way : (steps, n) metres along the normals,
    ascending; particles : (P, steps, n) occupancy of each particle; mean : (steps, n), over all of
    them; own : (steps, n), over those of the placed shape alone; beyond : (n,) metres from the end
    of the way to where the latter falls through 0.5, 0 where it does on the way; apart : (n,)
    metres, root mean square over all hypotheses of how far their surfaces are; spread : of the
    posterior
    """

    vertices: Array
    normals: Array
    way: Array
    particles: NDArray[np.float32]
    mean: NDArray[np.float32]
    own: NDArray[np.float32]
    beyond: Array
    apart: Array
    spread: SpreadConfig


@dataclass(frozen=True)
class Moved:
    """vertices : (n, 3) metres, camera frame; deviation : (n,) metres, standard deviation of the
    surface's place; off : share of the vertices that the level set is out of reach of
    """

    vertices: Array
    deviation: NDArray[np.float32]
    off: float


def along_normals(
    posterior: HypothesisPosterior, number: int, config: SurfaceConfig
) -> AlongNormals:
    """The way through the surface of hypothesis `number`, a placed shape: `config.farthest` metres
    outwards, and inwards no more than `config.wall_share` of the wall.

    The occupancy there is known without a look at the mesh: the shape's own logit falls by 1 /
    width a metre, and the correction, whose kernels are centimetres wide, stays what it is. Other
    hypotheses are evaluated at the ends and in the middle.
    """
    shape = placed(posterior, number)
    vertices, normals = shape.vertices, shape.normals
    inwards = np.minimum(config.farthest, config.wall_share * wall_thickness(shape))
    steps = np.linspace(-1, 1, config.steps)[:, None]
    way = np.where(steps < 0, steps * inwards, steps * config.farthest)
    correction = posterior.correction.logits(vertices)
    logits = np.repeat(correction[:, None], len(way), axis=1)
    apart = np.zeros(len(vertices))
    for each, mean in enumerate(posterior.means):
        if mean is shape:
            line: NDArray[np.floating] = np.clip(-way / shape.width, -shape.limit, shape.limit)
        else:
            ends = [_coarse(mean, vertices + way[[i]].T * normals)[0] for i in (0, -1)]
            middle, distance = _coarse(mean, vertices)
            line = middle + np.where(
                steps < 0, -steps * (ends[0] - middle), steps * (ends[1] - middle)
            )
            if distance is None:
                # As far as the logit falls to 0 by its slope here.
                fall = np.abs(ends[0] - ends[1]) / (way[-1] - way[0])
                distance = np.abs(middle) / np.maximum(fall, 1e-6)
            apart += posterior.weights[each] * np.minimum(distance, config.most_apart) ** 2
        logits[posterior.which == each] += line.astype(np.float32)
    particles = occupancy(logits)
    mean_occupancy = np.tensordot(posterior.shares, particles, axes=1).astype(np.float32)
    mine = posterior.which == number
    own = np.tensordot(
        posterior.shares[mine] / posterior.shares[mine].sum(), particles[mine], axes=1
    )
    first, last = np.clip(own[[0, -1]], 1e-6, 1 - 1e-6)
    short = np.maximum(np.log(1 / first - 1), -np.log(1 / last - 1))
    beyond = shape.width * np.maximum(short, 0.0)
    return AlongNormals(
        vertices,
        normals,
        way,
        particles,
        mean_occupancy,
        own.astype(np.float32),
        beyond,
        np.sqrt(apart),
        posterior.spread,
    )


def placed(posterior: HypothesisPosterior, number: int) -> PlacedShape:
    """Hypothesis `number`, which has to be a placed shape."""
    shape = posterior.means[number]
    assert isinstance(shape, PlacedShape)
    return shape


def spread_of_all(through: AlongNormals, own: NDArray[np.floating], width: float) -> Array:
    """(n,) metres, standard deviation of the place of the surface, of whichever hypothesis: how far
    they are apart, and the placed shape's `own` (n,). Where its surface is not met on the way, as
    in thin walls, its own is that of a logistic function of `width` metres and what is beyond."""
    alone = np.where(through.beyond > 0, np.hypot(LOGISTIC_DEVIATION * width, through.beyond), own)
    return np.asarray(np.hypot(alone, through.apart))


def moved_to_level(
    through: AlongNormals,
    level: float,
    occupancy_along: NDArray[np.float32] | None = None,
    *,
    stay: bool = False,
) -> Moved:
    """Each vertex where occupancy, by default the mean over all particles, falls through `level`,
    next to where it was; where it does not, at the end of the way that comes nearest to it, or,
    with `stay`, where it was."""
    above = (through.mean if occupancy_along is None else occupancy_along) - level
    falls = (above[:-1] >= 0) & (above[1:] < 0)
    middle = np.abs(through.way[:-1] + through.way[1:])
    row = np.argmin(np.where(falls, middle, np.inf), axis=0)
    column = np.arange(above.shape[1])
    before, after = above[row, column], above[row + 1, column]
    start, end = through.way[row, column], through.way[row + 1, column]
    gap = np.maximum(before - after, 1e-6)
    crossed = np.any(falls, axis=0)
    outside = above[len(above) // 2] < 0
    ends = np.where(outside, through.way[0], through.way[-1])
    ends = np.where(stay, 0.0, ends)
    offset = np.where(crossed, start + (end - start) * before / gap, ends)
    steepness = np.where(crossed, gap / np.maximum(end - start, 1e-9), 0.0)
    return Moved(
        through.vertices + offset[:, None] * through.normals,
        deviation(steepness, through.spread),
        float(1 - crossed.mean()),
    )


def wall_thickness(shape: PlacedShape) -> Array:
    """(n,) metres from each vertex through the object to its other side, along the normal."""
    o3d = import_open3d()
    vertices = shape.shape.vertices.astype(np.float64)
    # A little inside, so that no ray hits the face that it starts from.
    start = 1e-4
    rays = np.concatenate([vertices - start * shape.shape.normals, -shape.shape.normals], axis=1)
    query = o3d.core.Tensor(np.ascontiguousarray(rays, dtype=np.float32))
    hit = shape.shape.scene.cast_rays(query, nthreads=1)["t_hit"].numpy().astype(np.float64)
    return np.asarray((np.where(np.isfinite(hit), hit, np.inf) + start) * shape.unit)


def _coarse(mean: MeanFunction, points: Array) -> tuple[NDArray[np.float32], Array | None]:
    """Logits (n,) at points (n, 3), and the distances (n,), metres, to the surface of a placed
    shape, None of another: from its coarse field, which is all that averages over hypotheses
    need."""
    if isinstance(mean, PlacedShape):
        distance = mean.signed_distance(points, 0.0)
        logits = np.clip(-distance / mean.width, -mean.limit, mean.limit)
        return logits.astype(np.float32), np.abs(distance)
    return mean.logits(points), None
