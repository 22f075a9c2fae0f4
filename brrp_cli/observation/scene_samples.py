"""What a frame says about a whole scene: samples of one multi-class problem.

V-PRISM (Wright et al. 2024) labels each seen object's surface with that object's class, and with
one class for free space the camera rays in front of any surface and the space below the support
plane.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import ObservationConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.observation.ray_samples import below_samples, box_center, ray_samples
from brrp_cli.observation.subsample import grid_subsample
from brrp_cli.observation.support_plane import Plane, fit_plane

log = logging.getLogger(__name__)

FREE = 0


@dataclass(frozen=True)
class SceneSamples:
    """Samples of the scene, metres, camera frame.

    points : object id -> (n, 3) float32, all valid points of the mask, ids ascending
    centers : object id -> (3,) float64, the middle of their bounding box
    samples : (S, 3) float32
    labels : (S,) int64; FREE, or 1 + the place of the object's id in `points`
    plane : the support plane, camera frame; None where none was found or no object asks for one
    too_few : id -> number of valid points, for objects that have too few of them for a class
    """

    points: dict[int, NDArray[np.float32]]
    centers: dict[int, NDArray[np.float64]]
    samples: NDArray[np.float32]
    labels: NDArray[np.int64]
    plane: Plane | None = None
    too_few: dict[int, int] = field(default_factory=dict)


def sample_scene(frame: Frame, config: ObservationConfig, seed: int) -> SceneSamples:
    """Sample the frame around all of its objects. The same seed gives the same bytes."""
    seen = {i: frame.object_points(i) for i in frame.object_ids}
    too_few = {i: len(p) for i, p in seen.items() if len(p) < config.min_points}
    points = {i: p for i, p in seen.items() if i not in too_few}
    centers = {i: box_center(p) for i, p in points.items()}
    surfaces = [grid_subsample(p, config.surface_cell) for p in points.values()]
    free, plane = _free_samples(frame, centers, config, seed)
    groups = [free, *surfaces]
    return SceneSamples(
        points=points,
        centers=centers,
        samples=np.concatenate(groups),
        labels=np.repeat(np.arange(len(groups)), [len(group) for group in groups]),
        plane=plane,
        too_few=too_few,
    )


def _free_samples(
    frame: Frame, centers: dict[int, NDArray[np.float64]], config: ObservationConfig, seed: int
) -> tuple[NDArray[np.float32], Plane | None]:
    if not centers:
        return np.empty((0, 3), np.float32), None
    middles = np.array(list(centers.values()))
    free = [ray_samples(frame.points[frame.valid], middles, config, seed)]
    background = frame.points[frame.valid & (frame.segmap == BACKGROUND)]
    plane = fit_plane(background, config, seed, middles.mean(axis=0))
    if plane is None:
        log.warning("No support plane near the objects: nothing is sampled below one")
    else:
        free += [below_samples(c, plane, config, seed, i) for i, c in centers.items()]
    return grid_subsample(np.concatenate(free), config.free_cell), plane
