"""The support plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FloorConfig, ObservationConfig
from brrp_cli.dependencies import import_library, import_open3d, seeded_open3d
from brrp_cli.geometry import bounds, lengths, normalise, similarity, within
from brrp_cli.seeds import child_seed


@dataclass(frozen=True)
class Plane:
    """Points x with normal . x + offset = 0; the objects' side is positive.

    normal : (3,) float64, unit, camera frame; offset : metres.
    """

    normal: NDArray[np.float64]
    offset: float

    @classmethod
    def facing_the_camera(cls, model: NDArray[np.float64]) -> Plane:
        """Of (4,) a x + b y + c z + d = 0, unit normal of either sign: the camera's side is
        positive."""
        model = model if model[3] > 0 else -model
        return cls(model[:3].copy(), float(model[3]))

    def moved(self, T_target_cam: NDArray[np.float64]) -> Plane:
        """The same in another frame, which T_target_cam (4, 4), rigid, leads to."""
        normal = T_target_cam[:3, :3] @ self.normal
        return Plane(normal, float(self.offset - normal @ T_target_cam[:3, 3]))

    def signed_distance(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """(...,) metres above the plane of points (..., 3), camera frame."""
        return np.asarray(points @ self.normal + self.offset, dtype=np.float64)

    def met_by(self, directions: NDArray[np.floating]) -> NDArray[np.float64]:
        """Points (..., 3), metres, camera frame, where the camera's sight in directions (..., 3)
        meets the plane; NaN where it does not."""
        down = directions @ self.normal
        far = np.where(down < 0, -self.offset / np.where(down < 0, down, -1.0), np.nan)
        return np.asarray(directions * far[..., None], dtype=np.float64)


def fit_plane(
    points: NDArray[np.floating],
    config: ObservationConfig,
    seed: int,
    toward: NDArray[np.floating],
) -> Plane | None:
    """RANSAC over the points within `config.plane_radius` of the scene's centre.

    The plane of the largest consensus is fitted again, by least squares, to all of its inliers.

    points : (n, 3) background points, metres, camera frame, finite
    toward : (3,) the scene's centre
    The normal is turned to the camera: what is seen of a plane faces it. The scene's centre may lie
    below a table whose masks hold smeared pixels or things on the floor.
    Returns None where fewer than `config.plane_min_points` points are near or agree on a plane.
    """
    near = points[lengths(points - toward) < config.plane_radius]
    if len(near) < config.plane_min_points:
        return None
    centred = near.astype(np.float64) - toward
    model = largest_plane(
        centred,
        child_seed(seed, "plane"),
        tolerance=config.plane_tolerance,
        iterations=config.plane_iterations,
        drawn_points=config.plane_ransac_points,
        min_points=config.plane_min_points,
    )
    if model is None:
        return None
    offset = float(model[3] - model[:3] @ toward)
    if offset < 0:
        model, offset = -model, -offset
    return Plane(normal=model[:3].copy(), offset=offset)


def floor_beneath(
    plane: Plane,
    background: NDArray[np.floating],
    objects: NDArray[np.floating],
    config: FloorConfig,
) -> Plane:
    """The plane moved along its normal to what lies around the objects, where that is another one.

    The largest plane is the table, but things may lie in a bin, on a tray or on a board, whose
    surface is millimetres above it, or in a hollow.

    background, objects : (n, 3) and (m, 3) metres, camera frame
    """
    T = plane_frame(plane)
    near = background[np.abs(plane.signed_distance(background)) < config.band]
    if not len(near) or not len(objects):
        return plane
    around, on = (
        np.floor((points @ T[:2, :3].T) / config.cell).astype(np.int64)
        for points in (near, objects)
    )
    first, last = bounds(on)
    corner = first - config.reach
    held = np.zeros(last - corner + config.reach + 1, dtype=bool)
    held[tuple((on - corner).T)] = True
    beside = import_library("scipy.ndimage").binary_dilation(held, iterations=config.reach)
    index = around - corner
    there = within(index, np.zeros(2), np.array(held.shape) - 1)
    there[there] = beside[tuple(index[there].T)]
    height = plane.signed_distance(near[there])
    if len(height) < config.least_points:
        return plane
    middle = float(np.median(height))
    # Walls and the lower ends of what stands there are higher, and the table about them is lower.
    for _ in range(config.rounds):
        middle = float(np.median(height[np.abs(height - middle) <= config.spread]))
    return plane if abs(middle) < config.apart else Plane(plane.normal, plane.offset - middle)


def largest_plane(
    points: NDArray[np.float64],
    seed: int,
    *,
    tolerance: float,
    iterations: int,
    drawn_points: int,
    min_points: int,
) -> NDArray[np.float64] | None:
    """The plane (4,) a x + b y + c z + d = 0, unit normal, near which most of points (n, 3) lie.

    RANSAC (on `drawn_points` at most), then least squares on all inliers. None where fewer than
    `min_points` points are nearer than `tolerance`, metres.
    """
    if len(points) < max(3, min_points):
        return None
    drawn = points
    if len(points) > drawn_points:
        drawn = points[np.random.default_rng(seed).choice(len(points), drawn_points, False)]
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(drawn))
    # With probability 1 every iteration is run: stopping early depends on which thread is first.
    with seeded_open3d(seed):
        model, _ = cloud.segment_plane(
            tolerance, ransac_n=3, num_iterations=iterations, probability=1.0
        )
    length = np.linalg.norm(model[:3])
    if not length > 0:  # no three of the drawn points span a plane
        return None
    model = np.asarray(model) / length
    # From a few points nearly to where it lies, and from all of them once.
    for some in (drawn, points):
        inliers = some[np.abs(some @ model[:3] + model[3]) < tolerance]
        if len(inliers) < (min_points if some is points else 3):
            return None
        model = nearest_plane(inliers)
    return model


def nearest_plane(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The plane (4,) a x + b y + c z + d = 0, unit normal of either sign, of least squares of the
    distances to points (n, 3)."""
    middle = points.mean(axis=0)
    spread = points - middle
    normal = np.linalg.eigh(spread.T @ spread)[1][:, 0]
    return np.append(normal, -normal @ middle)


def plane_frame(plane: Plane) -> NDArray[np.float64]:
    """T_plane_cam (4, 4): z along the plane's normal, z = 0 on the plane; x and y arbitrary but
    always the same."""
    helper = np.eye(3)[np.argmin(np.abs(plane.normal))]
    x = normalise(np.cross(plane.normal, helper))
    rotation = np.stack([x, np.cross(plane.normal, x), plane.normal])
    return similarity(rotation=rotation, translation=np.array([0, 0, plane.offset]))
