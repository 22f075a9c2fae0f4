"""Where things stand on a table, and where the camera stands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import normalise, similarity, turn_about_z

if TYPE_CHECKING:
    import trimesh

AREA = (0.26, 0.20)  # metres: half-widths of the part of the table that is used
GAP = 0.02  # metres between the circles around two footprints
TRIES = 200


def stand_apart(
    meshes: Sequence[trimesh.Trimesh], rng: np.random.Generator
) -> list[NDArray[np.float64]] | None:
    """T_world_object of each mesh: upright on the plane z = 0, turned at random, clear of others.

    Footprints are kept apart by the circles around them. None if no place was found.
    """
    placed: list[tuple[NDArray[np.float64], float]] = []
    poses = []
    for mesh in meshes:
        radius = float(np.linalg.norm(mesh.vertices[:, :2], axis=1).max())
        for _ in range(TRIES):
            spot = rng.uniform(-1, 1, 2) * AREA
            if all(np.linalg.norm(spot - o) > radius + r + GAP for o, r in placed):
                break
        else:
            return None
        placed.append((spot, radius))
        poses.append(
            similarity(1.0, turn_about_z(rng.uniform(0, 2 * np.pi)), np.array([*spot, 0.0]))
        )
    return poses


def camera_pose(
    target: NDArray[np.floating], distance: float, pitch: float, yaw: float
) -> NDArray[np.float64]:
    """T_world_cam (4, 4) of a camera that looks at `target` (3,) from `distance` metres, down at
    `pitch`, from the direction `yaw` about z (radians). World z is up; the image is upright.
    """
    forward = -np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    right = normalise(np.cross(forward, [0.0, 0.0, 1.0]))
    rotation = np.column_stack([right, np.cross(forward, right), forward])
    return similarity(1.0, rotation, target - distance * forward)
