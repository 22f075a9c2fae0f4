"""The last step of a placement: what each ray would have met against what the camera measured.

The search brings observed points onto the nearest surface of a coarse field. In a wall thinner than
the field's nodes, the cup's or the clamp's, that is its middle: the placement ends half a wall too
near the camera. Here each pixel's ray is cast into the stored mesh itself, and only the side that
faces the camera pulls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config import RayRefinementConfig, SensorConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.geometry import transform_points
from brrp_cli.observation.sensor_noise import depth_deviation
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.shape import StoredShape

Array = NDArray[np.float64]


def refine_by_rays(
    T_cam_shape: Array,
    shape: StoredShape,
    observed: NDArray[np.floating],
    focal_length: float,
    plane: Plane | None,
    wave: float,
    sensor: SensorConfig,
    config: RayRefinementConfig,
    others: Sequence[OtherRays] = (),
) -> Array:
    """T_cam_shape (4, 4), a similarity, followed by the small rigid motion under which the rays of
    the observed points (n, 3), metres, camera frame, in random order, meet the shape where depth
    was measured. The placement as it was where that motion is none of a last step.

    focal_length : pixels, of the pixel's width; plane : what the object may stand on; wave :
    metres, standard deviation of the mean depth of a patch (observation/sensor_noise.py)
    others : what other views measured, each from a camera of its own
    """
    points = np.asarray(observed[: config.points], dtype=np.float64)
    middle = transform_points(T_cam_shape, shape.vertices.mean(axis=0, keepdims=True))[0]
    T = T_cam_shape.copy()
    for _ in range(config.steps):
        parts = [_ray_rows(T, shape, points, middle, focal_length, wave, sensor)]
        parts += [_other_rows(T, shape, other, middle, sensor, config) for other in others]
        rows, residuals, deviations = (np.concatenate(each) for each in zip(*parts, strict=True))
        rays = len(rows)
        if plane is not None:
            standing = _standing_row(T, shape, plane, middle, config)
            rows = np.concatenate([rows, standing[0]])
            residuals = np.concatenate([residuals, standing[1]])
            deviations = np.concatenate([deviations, standing[2]])
        # Tukey's biweight: what belongs to something else does not pull at all.
        share = np.clip(1 - (residuals / (config.outlier * deviations)) ** 2, 0, None) ** 2
        weight = share / deviations**2
        weight[:rays] *= config.independent
        normal = (rows * weight[:, None]).T @ rows
        normal += np.diag([config.turn**-2] * 3 + [config.shift**-2] * 3)
        step = np.linalg.solve(normal, rows.T @ (weight * residuals))
        T = _moved(T, np.asarray(step, dtype=np.float64), middle)
        if np.abs(step).max() < config.still:
            break
    return T if _small(T, T_cam_shape, middle, config) else T_cam_shape


@dataclass(frozen=True)
class OtherRays:
    """Another view of an object at rest: points (n, 3), metres, in its own camera frame, in random
    order; focal_length, wave : of it, as in `refine_by_rays`; T_view_cam : (4, 4) rigid, from this
    frame's camera to that one's"""

    points: NDArray[np.floating]
    focal_length: float
    wave: float
    T_view_cam: Array


def _other_rows(
    T: Array,
    shape: StoredShape,
    view: OtherRays,
    middle: Array,
    sensor: SensorConfig,
    config: RayRefinementConfig,
) -> tuple[Array, Array, Array]:
    """`_ray_rows` of another view, by turn and shift in this frame."""
    points = np.asarray(view.points[: config.points], dtype=np.float64)
    rows, residuals, deviations = _ray_rows(
        view.T_view_cam @ T,
        shape,
        points,
        np.asarray(transform_points(view.T_view_cam, middle), dtype=np.float64),
        view.focal_length,
        view.wave,
        sensor,
    )
    R = view.T_view_cam[:3, :3]
    # Row vectors: a product with R takes them from the view's axes to this frame's.
    return np.concatenate([rows[:, :3] @ R, rows[:, 3:] @ R], axis=1), residuals, deviations


def _ray_rows(
    T: Array,
    shape: StoredShape,
    points: Array,
    middle: Array,
    focal_length: float,
    wave: float,
    sensor: SensorConfig,
) -> tuple[Array, Array, Array]:
    """Derivatives (n, 6) by turn and shift, residuals (n,), metres along the surface's normal, of
    points from where their rays meet the shape, and the residuals' standard deviations (n,).

    A ray that misses the shape is held against its nearest point.
    """
    # Rays end at the points: one that ends on the surface goes once.
    length, away = shape.met(T, points)
    met = np.isfinite(length)
    on_surface = points * np.where(met, length, 1.0)[:, None]
    missed = np.flatnonzero(~met)
    if len(missed):
        local = transform_points(np.linalg.inv(T), points[missed])
        query = import_open3d().core.Tensor(local.astype(np.float32))
        closest = shape.scene.compute_closest_points(query, nthreads=1)["points"].numpy()
        on_surface[missed] = transform_points(T, closest.astype(np.float64))
        apart = points[missed] - on_surface[missed]
        away[missed] = apart / np.maximum(np.linalg.norm(apart, axis=1, keepdims=True), 1e-9)
    residuals = np.einsum("ni,ni->n", points - on_surface, away)
    rows = np.concatenate([np.cross(on_surface - middle, away), away], axis=1)
    cosine = np.einsum("ni,ni->n", points, away) / np.linalg.norm(points, axis=1)
    along = np.hypot(depth_deviation(points[:, 2], sensor), wave) * cosine
    across = points[:, 2] / focal_length * np.sqrt(np.clip(1 - cosine**2, 0, 1))
    return rows, residuals, np.hypot(along, across)


def _standing_row(
    T: Array, shape: StoredShape, plane: Plane, middle: Array, config: RayRefinementConfig
) -> tuple[Array, Array, Array]:
    """The same of the shape's lowest point, which touches the plane where the object stands on it;
    far above it, Tukey's biweight lets go."""
    vertices = transform_points(T, shape.vertices.astype(np.float64))
    height = vertices @ plane.normal + plane.offset
    lowest = int(np.argmin(height))
    row = np.concatenate([np.cross(vertices[lowest] - middle, plane.normal), plane.normal])
    return row[None], np.array([-height[lowest]]), np.array([config.standing])


def _moved(T: Array, step: Array, middle: Array) -> Array:
    """T turned about `middle` by step[:3], radians, and shifted by step[3:], metres."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix()
    motion[:3, 3] = middle + step[3:] - motion[:3, :3] @ middle
    return np.asarray(motion @ T)


def _small(T: Array, start: Array, middle: Array, config: RayRefinementConfig) -> bool:
    """Whether T differs from `start` by no more than a last step does."""
    motion = T @ np.linalg.inv(start)
    shift = transform_points(motion, middle[None])[0] - middle
    turn = Rotation.from_matrix(motion[:3, :3]).magnitude()
    return bool(np.linalg.norm(shift) < config.most_shift and turn < config.most_turn)
