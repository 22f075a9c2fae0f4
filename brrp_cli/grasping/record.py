"""grasps.json: every grasp, what decided it, and what fell."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.files import atomic_path
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.grasp import Grasp, GraspPlan
from brrp_cli.version import __version__

SCHEMA = 1
RECORD = "grasps.json"


def grasps_record(
    plan: GraspPlan, frame: str = "camera", T_frame_cam: NDArray[np.float64] | None = None
) -> dict[str, Any]:
    """Plain JSON, metres.

    frame : "camera" or "world", in which `T_FRAME_gripper` and contacts are given; T_frame_cam :
    (4, 4), to it
    """
    T = np.eye(4) if T_frame_cam is None else T_frame_cam
    key = f"T_{'cam' if frame == 'camera' else 'world'}_gripper"
    return {
        "schema": SCHEMA,
        "brrp": __version__,
        "frame": frame,
        "units": {"length": "metre", "angle": "degree"},
        "gripper": asdict(plan.gripper) | {"tip": plan.gripper.tip},
        "approach": plan.approach,
        "min_score": plan.min_score,
        "per_object": plan.per_object,
        "seed": plan.seed,
        "config": asdict(plan.config),
        "objects": [
            {
                "id": each.object_id,
                "why_none": each.why or None,
                "fell": each.fell,
                "grasps": [_grasp(grasp, key, T) for grasp in each.grasps],
            }
            for each in plan.objects
        ],
    }


def write_grasps(
    plan: GraspPlan,
    path: Path,
    frame: str = "camera",
    T_frame_cam: NDArray[np.float64] | None = None,
) -> None:
    """Write the record, whole or not at all. Errors: OutputError."""
    text = json.dumps(grasps_record(plan, frame, T_frame_cam), indent=1, allow_nan=False) + "\n"
    with atomic_path(path) as partial:
        partial.write_text(text)


def _grasp(grasp: Grasp, key: str, T: NDArray[np.float64]) -> dict[str, Any]:
    return {
        key: (T @ grasp.T_cam_gripper).tolist(),
        "score": grasp.score,
        "quality": grasp.quality,
        "opening": grasp.opening,
        "width": grasp.width,
        "contacts": np.asarray(transform_points(T, grasp.contacts)).tolist(),
    }
