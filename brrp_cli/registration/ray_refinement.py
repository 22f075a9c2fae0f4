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
from brrp_cli.geometry import normalise, transform_points
from brrp_cli.observation.sensor_noise import depth_deviation
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.shape import StoredShape
from brrp_cli.registration.mask_edges import MaskEdges
from brrp_cli.registration.ray_loops import pull_of_rays
from brrp_cli.registration.seen_mask import SeenMask
from brrp_cli.registration.turns import motions

Array = NDArray[np.float64]
# What residuals cost, nats, and the normal equations, (6, 6) and (6,), of turn and shift.
Pull = tuple[float, Array, Array]


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
    mask: SeenMask | None = None,
) -> Array:
    """T_cam_shape (4, 4), a similarity, followed by the small rigid motion under which the rays of
    the observed points (n, 3), metres, camera frame, in random order, meet the shape where depth
    was measured. The placement as it was where that motion is none of a last step.

    focal_length : pixels, of the pixel's width; plane : what the object may stand on; wave :
    metres, standard deviation of the mean depth of a patch (observation/sensor_noise.py)
    others : what other views measured, each from a camera of its own
    mask : of the object, where depth shows too little of it
    """
    own = OtherRays(observed, focal_length, wave, np.eye(4))
    views = [_looked_up(view, sensor, config) for view in (own, *others)]
    trust = [1.0 if mask is None else mask.trust, *(1.0 for _ in others)]
    middle = transform_points(T_cam_shape, shape.vertices.mean(axis=0, keepdims=True))[0]

    let_go = config.outlier * config.standing
    if mask is not None:
        let_go = max(let_go, (1 - mask.trust) * mask.config.high)

    def pull(T: Array) -> Pull:
        parts = [
            _of_view(T, shape, view, middle, share * config.independent, config.outlier)
            for view, share in zip(views, trust, strict=True)
        ]
        if plane is not None:
            parts.append(_of_standing(T, shape, plane, middle, let_go, config))
        if mask is not None:
            parts.append(_of_edges(T, shape, mask.edges, middle, config))
        costs, normals, falls = zip(*parts, strict=True)
        return sum(costs), np.sum(normals, axis=0), np.sum(falls, axis=0)

    before = np.diag([config.turn**-2] * 3 + [config.shift**-2] * 3)
    T = best = T_cam_shape
    cost, normal, fall = pull(T)
    least, since = cost, 0
    for _ in range(config.steps):
        step = np.linalg.solve(normal + before, fall)
        T = motions(np.asarray(step, dtype=np.float64)[None], middle)[0] @ T
        cost, normal, fall = pull(T)
        # Facets and silhouettes make the residuals jump: a step that makes it worse may lead on.
        since = 0 if cost < least - config.gain else since + 1
        # Of those that are as good the last: it is nearer to where the pulls are in balance.
        if cost < least + config.gain:
            best, least = T, min(least, cost)
        if since == config.patience or np.abs(step).max() < config.still:
            break
    return best if _small(best, T_cam_shape, middle, config) else T_cam_shape


@dataclass(frozen=True)
class OtherRays:
    """Another view of an object at rest: points (n, 3), metres, in its own camera frame, in random
    order; focal_length, wave : of it, as in `refine_by_rays`; T_view_cam : (4, 4) rigid, from this
    frame's camera to that one's"""

    points: NDArray[np.floating]
    focal_length: float
    wave: float
    T_view_cam: Array


@dataclass(frozen=True)
class _View:
    """points : (n, 3) metres, in the view's own camera frame; along : (n,) metres, standard
    deviation of each along its ray; pixel : the width of one, metres, at one metre;
    T_view_cam : as in `OtherRays`"""

    points: Array
    along: Array
    pixel: float
    T_view_cam: Array


def _looked_up(view: OtherRays, sensor: SensorConfig, config: RayRefinementConfig) -> _View:
    """What stays the same in all steps."""
    points = np.asarray(view.points[: config.points], dtype=np.float64)
    along = np.hypot(depth_deviation(points[:, 2], sensor), view.wave)
    return _View(points, along, 1 / view.focal_length, view.T_view_cam)


def _of_view(
    T: Array, shape: StoredShape, view: _View, middle: Array, independent: float, outlier: float
) -> Pull:
    """That of a view's points, of which the share `independent` counts, in this frame's camera,
    along the normals where their rays meet the shape.

    A ray that misses the shape is held against its nearest point.
    """
    points, T_view_shape = view.points, view.T_view_cam @ T
    # Rays end at the points: one that ends on the surface goes once.
    length, away = shape.met(T_view_shape, points)
    met = np.isfinite(length)
    on_surface = points * np.where(met, length, 1.0)[:, None]
    missed = np.flatnonzero(~met)
    if len(missed):
        closest, _ = shape.closest(transform_points(np.linalg.inv(T_view_shape), points[missed]))
        on_surface[missed] = transform_points(T_view_shape, closest)
        away[missed] = normalise(points[missed] - on_surface[missed])
    cost, normal, fall = pull_of_rays(
        points,
        on_surface,
        away,
        np.asarray(transform_points(view.T_view_cam, middle), dtype=np.float64),
        view.along,
        view.pixel,
        outlier,
        independent,
    )
    # From the view's axes to this frame's.
    turn = np.kron(np.eye(2), view.T_view_cam[:3, :3])
    return cost, turn.T @ normal @ turn, turn.T @ fall


def _of_standing(
    T: Array,
    shape: StoredShape,
    plane: Plane,
    middle: Array,
    let_go: float,
    config: RayRefinementConfig,
) -> Pull:
    """That of the shape's lowest point, which touches the plane where the object stands on it;
    `let_go` metres above it, Tukey's biweight lets go."""
    down = (T[:3, :3].T @ plane.normal).astype(np.float32)
    lowest = shape.vertices[int(np.argmin(shape.vertices @ down))].astype(np.float64)
    at = np.asarray(transform_points(T, lowest), dtype=np.float64)
    row = np.concatenate([np.cross(at - middle, plane.normal), plane.normal])
    height = float(at @ plane.normal + plane.offset)
    share = max(0.0, 1 - (height / let_go) ** 2)
    cost = (let_go / config.standing) ** 2 / 6 * (1 - share**3)
    weight = share**2 / config.standing**2
    return cost, weight * np.outer(row, row), -weight * height * row


def _of_edges(
    T: Array, shape: StoredShape, edges: MaskEdges, middle: Array, config: RayRefinementConfig
) -> Pull:
    """That of the mask's edges, which the shape reaches; far from them, Tukey's biweight lets
    go."""
    gap, rows = edges.gaps(T, shape.vertices.astype(np.float64), middle)
    share = np.maximum(0.0, 1 - (gap / (config.outlier * edges.deviation)) ** 2)
    weight = share**2 / edges.deviation**2
    cost = float((config.outlier**2 / 6 * (1 - share**3)).sum())
    return cost, rows.T @ (weight[:, None] * rows), rows.T @ (weight * gap)


def _small(T: Array, start: Array, middle: Array, config: RayRefinementConfig) -> bool:
    """Whether T differs from `start` by no more than a last step does."""
    motion = T @ np.linalg.inv(start)
    shift = transform_points(motion, middle[None])[0] - middle
    turn = Rotation.from_matrix(motion[:3, :3]).magnitude()
    return bool(np.linalg.norm(shift) < config.most_shift and turn < config.most_turn)
