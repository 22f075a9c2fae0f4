"""How far each point of a recognised object's mesh lies from where it truly is.

The distance of surfaces forgives a can that is turned about its axis; this does not, as a label
has its place (ADD of Hinterstoisser et al., ACCV 2012).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import rotation_angle, transform_points
from brrp_cli.ground_truth.truth import TrueObject
from brrp_cli.prior.objects import PriorObject
from brrp_cli.reconstruction import Retrieved

Array = NDArray[np.float64]
Row = dict[str, Any]

POSE = ("pose_error", "turn_error", "alike", "least_pose_error", "diameter")
RIGHT = 0.1  # of the diameter, below which a pose is usually counted as right
_SAME_BOX = 0.01  # of the half extent, by which the boxes of one mesh may differ


class TruePose(NamedTuple):
    """T_cam_mesh : (4, 4) similarity, the mesh's coordinates in metres to the camera frame; box :
    (2, 3) its corners in these coordinates."""

    T_cam_mesh: Array
    box: Array


def true_pose(true_object: TrueObject, vertices: Array, T_world_cam: Array) -> TruePose:
    """That of an object whose mesh has vertices (n, 3), world frame."""
    metres = np.diag([1 / true_object.unit] * 3 + [1.0])
    T_world_mesh = true_object.T_world_object @ metres
    own = transform_points(np.linalg.inv(T_world_mesh), vertices)
    box = np.stack([own.min(axis=0), own.max(axis=0)])
    return TruePose(np.linalg.inv(T_world_cam) @ T_world_mesh, box)


def pose_error(placed: Retrieved, stored: PriorObject, truth: TruePose) -> Row:
    """`POSE` of a recognised object: the mean distance, metres, of points of its mesh from where
    they truly are; the angle, degrees, by which it is turned from there; how many other poses the
    frame does not tell apart from that one, and the least such distance of all of them; the largest
    distance, metres, between any two points of the mesh. Empty where the true mesh has another box
    than the stored one: its coordinates are others, too."""
    assert placed.T_cam_object is not None
    vertices = stored.shape.vertices.astype(np.float64)
    ends = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
    box = stored.center + stored.half_extent * ends
    if np.abs(box - truth.box).max() > _SAME_BOX * stored.half_extent:
        return {}
    surface = stored.surface.astype(np.float64)
    points = stored.center + stored.half_extent * surface
    there = transform_points(truth.T_cam_mesh, points)

    def off(here: NDArray[np.floating]) -> float:
        return float(np.linalg.norm(here - there, axis=1).mean())

    error = off(transform_points(placed.T_cam_object, surface))
    size = 1.0 if placed.size_factor is None else placed.size_factor
    others = [off(transform_points(T_cam_mesh, size * points)) for T_cam_mesh in placed.alike]
    return {
        "pose_error": error,
        "turn_error": _turned(placed.T_cam_object, truth.T_cam_mesh),
        "alike": len(others),
        "least_pose_error": min([error, *others]),
        "diameter": _diameter(vertices) * stored.half_extent,
    }


def _turned(T: Array, other: Array) -> float:
    """Degrees between two similarities (4, 4)."""
    between = T[:3, :3].T @ other[:3, :3]
    return float(np.degrees(rotation_angle(between / np.cbrt(np.linalg.det(between)))))


def _diameter(vertices: Array) -> float:
    """The largest distance between two of vertices (n, 3)."""
    from scipy.spatial import ConvexHull
    from scipy.spatial.distance import pdist

    return float(pdist(vertices[ConvexHull(vertices).vertices]).max())
