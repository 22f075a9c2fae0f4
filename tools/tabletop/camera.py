"""Where a scene's camera stands, and its matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import SceneError

NEAR, FAR = 0.1, 5.0  # metres
FIELD_OF_VIEW = 45.0  # degrees, vertical: as in common RGBD cameras
STEEPEST = 89.0  # degrees: straight down, an image has no upper side


@dataclass(frozen=True)
class Camera:
    """OpenGL matrices (4, 4) for column vectors: camera from world, clip space from camera."""

    view: NDArray[np.float64]
    projection: NDArray[np.float64]


@dataclass(frozen=True)
class Standpoint:
    """Ranges that cameras are drawn from: distance from the objects, metres; elevation above the
    table and roll about the line of sight, degrees. Zero roll holds the camera upright."""

    distance: tuple[float, float] = (0.6, 1.0)
    elevation: tuple[float, float] = (25.0, 60.0)
    roll: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Errors: SceneError for a range that is empty or that no camera can stand in."""
        _checked("distance", self.distance, (2 * NEAR, FAR / 2))
        _checked("elevation", self.elevation, (5.0, STEEPEST))
        _checked("roll", self.roll, (-180.0, 180.0))


def draw_camera(
    center: NDArray[np.float64],
    size: tuple[int, int],
    rng: np.random.Generator,
    standpoint: Standpoint | None = None,
    azimuth: tuple[float, float] = (0, 2 * np.pi),
) -> Camera:
    """A camera that looks at `center` (3,) from within `standpoint`'s ranges.

    azimuth : radians about the table's normal, between which it stands: on any side
    """
    ranges = standpoint or Standpoint()
    distance = rng.uniform(*ranges.distance)
    around, elevation = rng.uniform(*azimuth), np.deg2rad(rng.uniform(*ranges.elevation))
    backward = np.array(
        [
            np.cos(elevation) * np.cos(around),
            np.cos(elevation) * np.sin(around),
            np.sin(elevation),
        ]
    )
    right = np.cross([0.0, 0.0, 1.0], backward)
    right /= np.linalg.norm(right)
    target = center + rng.uniform(-0.03, 0.03, 3)
    view = np.eye(4)
    view[:3, :3] = right, np.cross(backward, right), backward
    # Only where it is asked for, so that upright cameras take the numbers that they always took.
    if ranges.roll != (0.0, 0.0):
        view[:3, :3] = _rolled(rng.uniform(*ranges.roll)) @ view[:3, :3]
    view[:3, 3] = -view[:3, :3] @ (target + distance * backward)
    return Camera(view, perspective(size))


def gone_round(camera: Camera, center: NDArray[np.float64], degrees: float) -> Camera:
    """The camera after it has gone round `center` (3,), at its height, by so many degrees."""
    turn, middle = np.eye(4), np.eye(4)
    # The world turns the other way.
    turn[:3, :3] = _rolled(-degrees)
    middle[:3, 3] = center
    return Camera(camera.view @ middle @ turn @ np.linalg.inv(middle), camera.projection)


def perspective(size: tuple[int, int]) -> NDArray[np.float64]:
    """OpenGL projection (4, 4) for an image of `size` (width, height)."""
    width, height = size
    focal = 1 / np.tan(np.deg2rad(FIELD_OF_VIEW) / 2)
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = focal * height / width, focal
    projection[2, 2] = -(FAR + NEAR) / (FAR - NEAR)
    projection[2, 3] = -2 * FAR * NEAR / (FAR - NEAR)
    projection[3, 2] = -1
    return projection


def _rolled(degrees: float) -> NDArray[np.float64]:
    cosine, sine = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _checked(name: str, asked: tuple[float, float], allowed: tuple[float, float]) -> None:
    low, high = asked
    if not allowed[0] <= low <= high <= allowed[1]:
        raise SceneError(
            f"--{name} is no range that a camera can stand in",
            expected=f"two numbers from {allowed[0]:g} to {allowed[1]:g}, the smaller first",
            found=f"{low:g} {high:g}",
        )
