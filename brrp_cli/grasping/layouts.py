"""Grasps as arrays in the layouts of other programs.

GraspNet's API, `GraspGroup`: (n, 17) float32, each row [score, width, height, depth, rotation (9,
row by row), translation (3), object id]. Its gripper frame: x the approach, y the closing
direction; the origin is the grasp's centre, `depth` how far the fingertips reach beyond it.

contact_graspnet, what its inference.py saves and predict_scene_grasps returns: dictionaries by
object id: pred_grasps_cam (n, 4, 4), scores (n,), contact_pts (n, 3), gripper_openings (n,). Its
gripper frame is ours.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.grasping.grasp import GraspPlan

# Columns of GraspNet's gripper frame among ours: its x is our z, its y our x, its z our y.
_GRASPNET_AXES = [2, 0, 1]


def graspnet_array(plan: GraspPlan) -> NDArray[np.float32]:
    """(n, 17), best first, metres, camera frame."""
    rows = []
    for grasp in plan.grasps:
        R = grasp.T_cam_gripper[:3, :3]
        centre = grasp.contacts.mean(axis=0)
        depth = plan.gripper.tip - (centre - grasp.T_cam_gripper[:3, 3]) @ R[:, 2]
        rows.append(
            [
                grasp.score,
                grasp.opening,
                plan.gripper.finger_width,
                depth,
                *R[:, _GRASPNET_AXES].ravel(),
                *centre,
                grasp.object_id,
            ]
        )
    return np.array(rows, dtype=np.float32).reshape(-1, 17)


def contact_graspnet_arrays(plan: GraspPlan) -> dict[str, dict[int, NDArray[np.float32]]]:
    """By name, then by object id, metres, camera frame; objects without a grasp have none."""
    found: dict[str, dict[int, Any]] = {
        "pred_grasps_cam": {},
        "scores": {},
        "contact_pts": {},
        "gripper_openings": {},
    }
    for each in plan.objects:
        if not each.grasps:
            continue
        of = each.object_id
        found["pred_grasps_cam"][of] = np.stack([g.T_cam_gripper for g in each.grasps])
        found["scores"][of] = np.array([g.score for g in each.grasps])
        found["contact_pts"][of] = np.stack([g.contacts[0] for g in each.grasps])
        found["gripper_openings"][of] = np.array([g.opening for g in each.grasps])
    return {
        name: {of: values.astype(np.float32) for of, values in table.items()}
        for name, table in found.items()
    }


def save_graspnet(plan: GraspPlan, path: Path) -> None:
    """What `GraspGroup.from_npy` reads."""
    with path.open("wb") as stream:
        np.save(stream, graspnet_array(plan))


def save_contact_graspnet(plan: GraspPlan, path: Path) -> None:
    """What contact_graspnet's programs read with `np.load(path, allow_pickle=True)`."""
    arrays: dict[str, Any] = dict(contact_graspnet_arrays(plan))
    with path.open("wb") as stream:
        np.savez(stream, **arrays)


# Name of a format -> name of its file, and what writes it.
LAYOUTS: dict[str, tuple[str, Callable[[GraspPlan, Path], None]]] = {
    "graspnet": ("grasps.npy", save_graspnet),
    "contact-graspnet": ("grasps.npz", save_contact_graspnet),
}
