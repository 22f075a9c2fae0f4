"""A picture of a stored object, in its colours, as it stands most probably."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import normalise, transform_points
from brrp_cli.prior.objects import PriorObject
from brrp_cli.reconstruction import Surface
from brrp_cli.rendering.render import PinholeView, fitted, render

# Where the camera stands, seen from the object: a little above it, in front of a corner.
DIRECTION = np.array([1.0, -1.6, 0.9])
# In diagonals of the object: far enough for little perspective.
DISTANCE = 3.0
SIZE = 480  # pixels


def portrait(item: PriorObject) -> NDArray[np.uint8]:
    """(SIZE, SIZE, 3) picture of the object in its most probable resting pose, z up."""
    metres = item.half_extent * np.asarray(item.shape.vertices, dtype=np.float64) + item.center
    standing: NDArray[np.float64] = transform_points(item.poses[0].T_plane_object, metres).astype(
        np.float64
    )
    low, high = standing.min(axis=0), standing.max(axis=0)
    diagonal = float(np.linalg.norm(high - low))
    surface = Surface(
        standing,
        np.asarray(item.shape.faces, dtype=np.int64),
        np.zeros(len(standing), np.float32),
        "",
    )
    eye = (low + high) / 2 + DISTANCE * diagonal * normalise(DIRECTION)
    view = PinholeView(
        np.array([[SIZE, 0, SIZE / 2], [0, SIZE, SIZE / 2], [0, 0, 1.0]]),
        _looking(eye, (low + high) / 2),
        (SIZE, SIZE),
    )
    return render([surface], [item.shape.colours], fitted(view, [surface]))


def _looking(eye: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """T_cam_plane (4, 4) of a camera at `eye` (3,) that looks at `target` (3,), z up in its
    picture."""
    forward = normalise(target - eye)
    right = normalise(np.cross(forward, [0.0, 0.0, 1.0]))
    T = np.eye(4)
    T[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    T[:3, 3] = -T[:3, :3] @ eye
    return T
