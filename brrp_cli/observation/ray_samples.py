"""What a frame says about each object: samples labelled occupied or free.

Paper, section IV-C (observed samples): the seen surface is occupied; camera rays in front of it,
space below the support plane and the surfaces of other objects are free.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import ObservationConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.last_frame import kept_for_last_frame
from brrp_cli.geometry import bounds
from brrp_cli.observation.borne import supporting_plane
from brrp_cli.observation.subsample import grid_subsample
from brrp_cli.observation.support_plane import Plane, floor_beneath
from brrp_cli.seeds import child_rng

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ObjectObservation:
    """One object's samples, metres, camera frame.

    points : (n, 3) float32, all valid points of the mask; center : (3,) float64, the middle of
    their bounding box; samples : (S, 3) float32; labels : (S,) bool, True = occupied.
    """

    object_id: int
    points: NDArray[np.float32]
    center: NDArray[np.float64]
    samples: NDArray[np.float32]
    labels: NDArray[np.bool_]

    def with_points(self, points: NDArray[np.float32], cell: float) -> ObjectObservation:
        """The same with other points (n, 3) of its surface, thinned to samples on a grid of `cell`
        metres."""
        occupied = grid_subsample(points, cell)
        samples = np.concatenate([occupied, self.samples[~self.labels]])
        labels = np.arange(len(samples)) < len(occupied)
        return replace(self, points=points, samples=samples, labels=labels)


@dataclass(frozen=True)
class SampledScene:
    """What samples of every object with enough points are taken from, metres, camera frame.

    plane : None where no support plane was found, and then no sample comes from below it
    points, surfaces : id -> (n, 3) float32, valid points of the mask, and those thinned; rays :
    (m, 3) float32 free samples in front of what was seen; too_few : id -> number of valid points,
    for the other objects
    """

    plane: Plane | None
    points: dict[int, NDArray[np.float32]]
    surfaces: dict[int, NDArray[np.float32]]
    rays: NDArray[np.float32]
    too_few: dict[int, int]
    config: ObservationConfig
    seed: int

    def observation(self, object_id: int) -> ObjectObservation:
        """Samples of one object; the same, whichever others are asked for."""
        config = self.config
        center = box_center(self.points[object_id])
        free = [_within(self.rays, center, config.ray_radius)]
        if self.plane is not None:
            free.append(below_samples(center, self.plane, config, self.seed, object_id))
        free = [
            grid_subsample(np.concatenate(free), config.free_cell),
            *(
                _within(other, center, config.ray_radius)
                for i, other in self.surfaces.items()
                if i != object_id
            ),
        ]
        occupied = self.surfaces[object_id]
        samples = np.concatenate([occupied, *free])
        return ObjectObservation(
            object_id=object_id,
            points=self.points[object_id],
            center=center,
            samples=samples,
            labels=np.arange(len(samples)) < len(occupied),
        )


@dataclass(frozen=True)
class SceneObservation:
    """Samples of every object with enough points.

    plane : None where no support plane was found, and then no sample comes from below it
    objects : by id, ascending; too_few : id -> number of valid points, for the other objects
    """

    plane: Plane | None
    objects: dict[int, ObjectObservation]
    too_few: dict[int, int] = field(default_factory=dict)


def observe(frame: Frame, config: ObservationConfig, seed: int) -> SceneObservation:
    """Sample the frame around each of its objects. The same seed gives the same bytes."""
    scene = sampled_scene(frame, config, seed)
    objects = {object_id: scene.observation(object_id) for object_id in scene.points}
    return SceneObservation(plane=scene.plane, objects=objects, too_few=scene.too_few)


def sampled_scene(
    frame: Frame, config: ObservationConfig, seed: int, *known: Plane | None
) -> SampledScene:
    """What objects are sampled from. known : the support plane, where it is known already."""
    points = {i: frame.object_points(i) for i in frame.object_ids}
    too_few = {i: len(p) for i, p in points.items() if len(p) < config.min_points}
    points = {i: p for i, p in points.items() if i not in too_few}
    if not points:
        nothing = np.zeros((0, 3), np.float32)
        return SampledScene(None, {}, {}, nothing, too_few, config, seed)
    (plane,) = known or (scene_plane(frame, config, seed),)
    if plane is None:
        log.warning("No support plane near the objects: nothing is sampled below one")
    centers = np.array([box_center(p) for p in points.values()])
    rays = ray_samples(frame.points[frame.valid], centers, config, seed)
    surfaces = {i: grid_subsample(p, config.surface_cell) for i, p in points.items()}
    return SampledScene(plane, points, surfaces, rays, too_few, config, seed)


def without_samples(frame: Frame, object_id: int) -> ObjectObservation:
    """The points of one object, of which there are some, and no samples."""
    points = frame.object_points(object_id)
    none = np.zeros((0, 3), np.float32), np.zeros(0, np.bool_)
    return ObjectObservation(object_id, points, box_center(points), *none)


@kept_for_last_frame
def scene_plane(frame: Frame, config: ObservationConfig, seed: int) -> Plane | None:
    """The support plane of a frame's objects, of those with enough points where there are any; None
    where none is found."""
    points = [frame.object_points(i) for i in frame.object_ids]
    seen = [p for p in points if len(p) >= config.min_points] or [p for p in points if len(p)]
    if not seen:
        return None
    centers = [box_center(p) for p in seen]
    background = frame.points[frame.valid & (frame.segmap == BACKGROUND)]
    things = np.concatenate(points)
    plane = supporting_plane(background, things, config, seed, np.mean(centers, axis=0))
    if plane is None or config.floor is None:
        return plane
    return floor_beneath(plane, background, things, config.floor)


def ray_samples(
    points: NDArray[np.float32], centers: NDArray[np.float64], config: ObservationConfig, seed: int
) -> NDArray[np.float32]:
    """Stratified free samples (m, 3) in front of seen points (n, 3), near any centre (k, 3).

    One uniform draw in every `ray_bin` of each ray from the camera, the last bin cut at the
    surface; kept within `ray_radius` of a centre; `max_ray_samples` at most.
    """
    rng = child_rng(seed, "rays")
    radius, width = config.ray_radius, config.ray_bin
    # The axis comes first: long contiguous rows are what NumPy is fast on.
    columns = np.ascontiguousarray(points.T)
    length = np.sqrt(np.square(columns, dtype=np.float64).sum(axis=0)).astype(np.float32)
    direction = columns / length
    # Rays that pass no centre give no sample; the margin is for float32.
    crossing, across = np.zeros(len(length), dtype=bool), np.empty(len(length))
    along = centers.astype(np.float32) @ direction  # (k, n): where each ray passes each centre
    for row, square in zip(along, np.square(centers).sum(axis=1), strict=True):
        np.square(row, out=across, dtype=np.float64)
        np.subtract(square, across, out=across)
        crossing |= across < (radius + 1e-3) ** 2
    length, direction = length[crossing], direction[:, crossing]

    reach = np.linalg.norm(centers, axis=-1)
    first = max(0, int((reach.min() - radius) // width))
    last = int((reach.max() + radius) // width)
    kept = []
    for index in range(first, last + 1):
        start = np.float32(index * width)
        reaching = np.flatnonzero(length > start)
        span = np.minimum(length[reaching] - start, np.float32(width))
        t = start + rng.random(len(span), dtype=np.float32) * span
        draws = direction.take(reaching, axis=1)
        draws *= t
        kept.append(draws.take(np.flatnonzero(_near_any(draws.T, centers, radius)), axis=1))
    samples = np.ascontiguousarray(np.concatenate(kept, axis=1).T)
    if len(samples) > config.max_ray_samples:
        rows = child_rng(seed, "rays", "subset").choice(
            len(samples), config.max_ray_samples, replace=False
        )
        samples = samples[np.sort(rows)]
    return samples


def below_samples(
    center: NDArray[np.float64], plane: Plane, config: ObservationConfig, seed: int, object_id: int
) -> NDArray[np.float32]:
    """Uniform draws (m, 3) in a ball around `center`, those below the plane."""
    rng = child_rng(seed, "below", object_id)
    direction = rng.standard_normal((config.below_draws, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    radius = config.below_radius * rng.random(config.below_draws) ** (1 / 3)
    draws = center + radius[:, None] * direction
    below: NDArray[np.float32] = draws[plane.signed_distance(draws) < 0].astype(np.float32)
    return below


def box_center(points: NDArray[np.float32]) -> NDArray[np.float64]:
    """Middle (3,) of the bounding box of points (n, 3)."""
    least, most = bounds(points)
    return (least.astype(np.float64) + most) / 2


def _near_any(
    points: NDArray[np.float32], centers: NDArray[np.float64], radius: float
) -> NDArray[np.bool_]:
    near = np.zeros(len(points), dtype=bool)
    # One piece of memory for all steps: to ask for new ones takes longer than they do.
    square, along = np.empty((2, len(points)), np.float32)
    for center in centers.astype(np.float32):
        for axis in range(3):
            into = square if axis == 0 else along
            np.subtract(points[:, axis], center[axis], out=into)
            into *= into
            if axis:
                square += along
        near |= square < radius**2
    return near


def _within(
    points: NDArray[np.float32], center: NDArray[np.float64], radius: float
) -> NDArray[np.float32]:
    return points[_near_any(points, center[None], radius)]
