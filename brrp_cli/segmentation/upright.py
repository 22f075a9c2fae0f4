"""Frames of a camera that hangs upside down or lies on its side, turned so that the table's upper
side is up in the image, as in nearly all that the networks have seen."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces, see_surfaces

Pixel = TypeVar("Pixel", bound=np.generic)


def quarter_turns(plane: Plane, config: SegmentConfig) -> int:
    """By how many quarter turns, counter-clockwise, 0 to 3, the image is upright; 0 where the
    camera looks so steeply down on the table that no side of the image is its upper one."""
    right, down = plane.normal[:2]
    if np.hypot(right, down) < np.sin(np.radians(config.steep)):
        return 0
    # Up is where x = 0 and y < 0. A turn counter-clockwise takes what is on the right up there.
    return int(np.rint(np.arctan2(right, -down) / (np.pi / 2))) % 4


def see_upright(frame: Frame, seed: int, config: SegmentConfig) -> tuple[Frame, SeenSurfaces, int]:
    """The frame, and what is seen in it, after so many quarter turns, counter-clockwise, that it is
    upright; as it is, and 0, where another table would be found then.

    Errors: as of `see_surfaces`.
    """
    seen = see_surfaces(frame, seed, config)
    turns = quarter_turns(seen.table.plane, config)
    if not turns:
        return frame, seen, 0
    standing = turned(frame, turns)
    try:
        again = see_surfaces(standing, seed, config)
    except FrameError:
        return frame, seen, 0
    expected = seen.table.plane.moved(turned_camera(turns)).normal
    same = expected @ again.table.plane.normal > np.cos(np.radians(config.steep))
    return (standing, again, turns) if same else (frame, seen, 0)


def turned_camera(turns: int) -> NDArray[np.float64]:
    """(4, 4) from the camera's frame to that of `turned`."""
    T = np.eye(4)
    T[:2, :2] = np.linalg.matrix_power(np.array([[0.0, 1.0], [-1.0, 0.0]]), turns % 4)
    return T


def turned(frame: Frame, turns: int) -> Frame:
    """The frame after so many quarter turns, counter-clockwise, of its image, and of its camera
    about the line of sight. The camera's pose is left out."""
    points, K = frame.points, frame.K
    for _ in range(turns % 4):
        width = points.shape[1]
        x, y, z = np.moveaxis(np.rot90(points), -1, 0)
        points = np.stack([y, -x, z], axis=-1)
        K = np.array([[K[1, 1], 0, K[1, 2]], [0, K[0, 0], width - 1 - K[0, 2]], [0, 0, 1]])
    aside = None if frame.aside is None else np.rot90(frame.aside, turns)
    return replace(
        frame,
        rgb=np.rot90(frame.rgb, turns),
        points=points,
        segmap=np.rot90(frame.segmap, turns),
        aside=aside,
        K=K,
        T_world_cam=None,
        stream_pose=None,
    )


def turned_back(image: NDArray[Pixel], turns: int) -> NDArray[Pixel]:
    """(H, W) of a turned frame, as an image of the frame itself."""
    return np.ascontiguousarray(np.rot90(image, -turns))
