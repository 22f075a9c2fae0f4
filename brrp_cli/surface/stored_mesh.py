"""The mesh of a recognised object: the stored one, moved along its normals to the posterior's level
set.

Its topology, its sharp edges and its thin walls survive, which a grid would lose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior, MeanFunction, deviation
from brrp_cli.inference.placed_shape import PlacedShape

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MovedMesh:
    """vertices : (n, 3) metres, camera frame; faces : (m, 3); colours : (n, 3) uint8; deviation :
    (n,) metres, standard deviation of the surface's place
    off : share of the vertices that the level set is further away from than the mesh may be moved
    """

    vertices: Array
    faces: NDArray[np.int64]
    colours: NDArray[np.uint8]
    deviation: NDArray[np.float32]
    off: float


def moved_mesh(posterior: HypothesisPosterior, number: int, config: SurfaceConfig) -> MovedMesh:
    """The mesh of hypothesis `number`, a placed shape, at the level set of the whole posterior.

    Along each vertex's normal the occupancy is known without a look at the mesh: the shape's own
    logit falls by 1 / width a metre, and the correction, whose kernels are centimetres wide, stays
    what it is. Other hypotheses are evaluated at the ends and in the middle of the way.
    """
    shape = posterior.means[number]
    assert isinstance(shape, PlacedShape)
    vertices, normals = shape.vertices, shape.normals
    farthest = np.minimum(config.farthest, config.wall_share * wall_thickness(shape))
    steps = np.linspace(-1, 1, config.steps)
    logits = _along_normals(posterior, number, vertices, normals, farthest, steps)
    # Near the surface the posterior is not zero or one, and probabilities are averaged as such.
    occupancy = posterior.mean_occupancy(logits)  # (steps, n)
    offset, steepness, crossed = _crossing(occupancy, steps, farthest, config.level)
    return MovedMesh(
        vertices + offset[:, None] * normals,
        shape.shape.faces.astype(np.int64),
        shape.shape.colours,
        deviation(steepness),
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


def _along_normals(
    posterior: HypothesisPosterior,
    number: int,
    vertices: Array,
    normals: Array,
    farthest: Array,
    steps: Array,
) -> NDArray[np.float32]:
    """Logits (P, steps, n) of each particle on the way from -farthest to farthest along the
    normals."""
    correction = posterior.correction.logits(vertices)
    found = np.repeat(correction[:, None], len(steps), axis=1)
    for each, mean in enumerate(posterior.means):
        if each == number and isinstance(mean, PlacedShape):
            way = steps[:, None] * farthest
            line = np.clip(-way / mean.width, -mean.limit, mean.limit)
        else:
            ends = [
                _far_logits(mean, vertices + s * farthest[:, None] * normals) for s in (-1, 0, 1)
            ]
            line = np.where(
                steps[:, None] < 0,
                ends[1] + steps[:, None] * (ends[1] - ends[0]),
                ends[1] + steps[:, None] * (ends[2] - ends[1]),
            )
        found[posterior.which == each] += line.astype(np.float32)
    return found


def _far_logits(mean: MeanFunction, points: Array) -> NDArray[np.float32]:
    """Logits from a shape's coarse field, which is all that the average over hypotheses needs."""
    if isinstance(mean, PlacedShape):
        distance = mean.signed_distance(points, 0.0)
        return np.clip(-distance / mean.width, -mean.limit, mean.limit).astype(np.float32)
    return mean.logits(points)


def _crossing(
    occupancy: NDArray[np.float32], steps: Array, farthest: Array, level: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Where occupancy (steps, n) falls through `level`, nearest to the middle: offset (n,) metres,
    how steeply (n,) per metre, and whether it does; where it does not, the end where it comes
    nearest."""
    above = occupancy - level
    falls = (above[:-1] >= 0) & (above[1:] < 0)
    middle = np.abs(steps[:-1] + steps[1:])[:, None]
    first = np.argmin(np.where(falls, middle, np.inf), axis=0)
    column = np.arange(occupancy.shape[1])
    before, after = above[first, column], above[first + 1, column]
    gap = np.maximum(before - after, 1e-6)
    width = steps[1] - steps[0]
    at = steps[first] + width * before / gap
    crossed: NDArray[np.bool_] = np.any(falls, axis=0)
    at = np.where(crossed, at, np.where(above[len(steps) // 2] >= 0, 1.0, -1.0))
    steepness = np.where(crossed, gap / (width * farthest), 0.0)
    return np.asarray(at * farthest), np.asarray(steepness), crossed
