"""One true object as the metrics ask for it: occupancy on grids, points of its surface.

All of it depends on the scene alone, so that every method is held against the same points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import depth_behind
from brrp_cli.geometry import grid_nodes, transform_points
from brrp_cli.ground_truth.metrics import evaluation_grid, sample_surface
from brrp_cli.ground_truth.true_meshes import ClosedMeshes
from brrp_cli.raycast import inside
from brrp_cli.reconstruction import Axes

Points = NDArray[np.floating]
Flags = NDArray[np.bool_]

HALF_WIDTH = 0.2  # metres: the grids reach so far from the middle of the true bounding box
SPACING = 0.015  # metres, published grid
FINE = 0.005  # metres, fine grid
NEAR_MARGIN, NEAR_SPACING = 0.05, 0.01  # metres: where probabilities are judged
SURFACE_POINTS = 8_000


@dataclass(frozen=True)
class TrueShape:
    """Metres, camera frame.

    Attributes
    ----------
    closed, exact : occupancy (27^3,) at `grid` (27^3, 3), whose axes are the world's; by the mesh
        that the published tables would use and by the one that is not thickened
    T_cam_grid : (4, 4), from indices of the published grid to the camera frame
    fine_exact : (81, 81, 81) occupancy on the grid `fine`, along the camera's axes
    closed_surface, exact_surface : (8000, 3) points of the two surfaces
    near : (n, 3) points of a 1 cm grid in the true bounding box, grown by 5 cm; near_exact : (n,)
        their occupancy; occluded : (n,) which of them lie behind what the camera saw
    """

    mesh: ClosedMeshes
    grid: Points
    T_cam_grid: Points
    closed: Flags
    exact: Flags
    fine: Axes
    fine_exact: Flags
    closed_surface: Points
    exact_surface: Points
    near: Points
    near_exact: Flags
    occluded: Flags


def true_shape(meshes: ClosedMeshes, frame: Frame, rng: np.random.Generator) -> TrueShape:
    """What the metrics ask of an object with these meshes (world metres), seen in `frame`."""
    assert frame.T_world_cam is not None
    T_cam_world = np.linalg.inv(frame.T_world_cam)
    box = np.asarray(meshes.exact.bounds)
    world = evaluation_grid(box.mean(axis=0), HALF_WIDTH, SPACING)
    T_world_grid = np.diag([SPACING, SPACING, SPACING, 1.0])
    T_world_grid[:3, 3] = world[0]
    near = _near_grid(box[0] - NEAR_MARGIN, box[1] + NEAR_MARGIN)

    seen = meshes.moved(T_cam_world)
    center = np.asarray(seen.exact.bounds).mean(axis=0)
    fine = evaluation_grid(center, HALF_WIDTH, FINE)
    side = round(len(fine) ** (1 / 3))
    axes = fine.reshape(side, side, side, 3)
    near_cam = transform_points(T_cam_world, near)
    return TrueShape(
        mesh=seen,
        grid=transform_points(T_cam_world, world),
        T_cam_grid=T_cam_world @ T_world_grid,
        closed=inside(meshes.for_iou, world),
        exact=inside(meshes.exact, world),
        fine=(axes[:, 0, 0, 0], axes[0, :, 0, 1], axes[0, 0, :, 2]),
        fine_exact=inside(seen.exact, fine).reshape(side, side, side),
        closed_surface=sample_surface(seen.for_chamfer, SURFACE_POINTS, rng),
        exact_surface=sample_surface(seen.exact, SURFACE_POINTS, rng),
        near=near_cam,
        near_exact=inside(meshes.exact, near),
        occluded=behind_seen(near_cam, frame),
    )


def behind_seen(points: Points, frame: Frame) -> Flags:
    """Which of `points` (n, 3), camera frame, lie behind the depth measured along their ray.

    Points outside of the image and on pixels without depth do not.
    """
    # NaN, no return, compares as false.
    return np.asarray(depth_behind(points, frame) < 0)


def _near_grid(low: Points, high: Points) -> Points:
    """Points (n, 3), `NEAR_SPACING` apart, symmetric in the box from low (3,) to high (3,)."""
    axes = []
    for start, stop in zip(low, high, strict=True):
        steps = int(np.floor((stop - start) / NEAR_SPACING))
        axes.append((start + stop) / 2 + (np.arange(steps + 1) - steps / 2) * NEAR_SPACING)
    return grid_nodes(axes).reshape(-1, 3)
