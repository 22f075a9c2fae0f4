"""The grasps of a folder of results for MoveIt: as frames on objects, and as moveit_msgs/Grasp."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import ResultError
from brrp_cli.files import parse_json, trouble_of
from brrp_cli.planning.moveit import pose

Array = NDArray[np.float64]
GRASPS = "grasps.json"


def stored_grasps(folder: Path) -> dict[str, list[dict[str, Any]]]:
    """Of the grasps.json in a folder of results, by name of the object, best first: `T` (4, 4),
    T_frame_gripper in the frame of the results, `score`, `approach`, metres back to the pre-grasp.

    None without that file. Errors: ResultError for one that cannot be read.
    """
    path = folder / GRASPS
    if not path.exists():
        return {}
    try:
        record = parse_json(path.read_text(encoding="utf-8"))
        key = "T_world_gripper" if record["frame"] == "world" else "T_cam_gripper"
        back = float(record["config"]["approach"])
        return {
            f"object_{int(item['id'])}": [
                {
                    "T": np.array(grasp[key], dtype=np.float64).reshape(4, 4),
                    "score": float(grasp["score"]),
                    "approach": back,
                }
                for grasp in item["grasps"]
            ]
            for item in record["objects"]
        }
    except (OSError, ValueError, KeyError, TypeError, OverflowError) as error:
        raise ResultError(
            "The grasps cannot be read",
            where=path,
            found=trouble_of(error),
            fix="run `brrp grasp` again, or remove the file",
        ) from error


def grasp_frames(
    grasps: Mapping[str, list[dict[str, Any]]],
) -> dict[str, list[tuple[str, Array]]]:
    """Frames `grasp_0` (the best), `grasp_1`, ... of each object."""
    return {
        name: [(f"grasp_{i}", grasp["T"]) for i, grasp in enumerate(mine)]
        for name, mine in grasps.items()
    }


def grasp_messages(
    grasps: Mapping[str, list[dict[str, Any]]], up: NDArray[np.floating], frame_id: str
) -> dict[str, list[dict[str, Any]]]:
    """moveit_msgs/Grasp, by object: approach along the hand's z, retreat upwards. The postures of
    the hand's joints, which only its robot has names for, are left out.

    up : (3,) in the frame of the results
    """
    return {
        name: [
            {
                "id": f"{name}/grasp_{i}",
                "grasp_pose": {"header": {"frame_id": frame_id}, "pose": pose(grasp["T"])},
                "grasp_quality": grasp["score"],
                "pre_grasp_approach": _way(grasp["T"][:3, 2], grasp["approach"], frame_id),
                "post_grasp_retreat": _way(up, grasp["approach"], frame_id),
            }
            for i, grasp in enumerate(mine)
        ]
        for name, mine in grasps.items()
    }


def _way(direction: NDArray[np.floating], distance: float, frame_id: str) -> dict[str, Any]:
    """moveit_msgs/GripperTranslation."""
    vector = dict(zip("xyz", (float(v) for v in direction), strict=True))
    return {
        "direction": {"header": {"frame_id": frame_id}, "vector": vector},
        "desired_distance": distance,
        "min_distance": distance / 2,
    }
