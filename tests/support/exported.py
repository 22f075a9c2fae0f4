"""Made results with something that has no mask around them, exported, and hands planned there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from click.testing import CliRunner
from made_result import write_made_result
from table_scene import T_CAM_WORLD, in_camera

from brrp_cli.cli import main
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.grasp import GraspPlan


def exported(folder: Path, around: trimesh.Trimesh) -> Path:
    """The folder of plans of results, in the world, of which `around`, world, has no mask."""
    results = write_made_result(
        folder / "out", frame="world", unmasked=in_camera(around, T_CAM_WORLD)
    )
    arguments = ["export", str(results), "--collision", "hull", "--moveit"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    return results / "plan"


def swept(plan: GraspPlan, solid: trimesh.Trimesh) -> int:
    """How many hands reach into a solid, world, on their way in or at its end."""
    points = transform_points(T_CAM_WORLD, solid.sample(20_000, seed=0))
    count = 0
    for grasp in (grasp for item in plan.objects for grasp in item.grasps):
        local = transform_points(np.linalg.inv(grasp.T_cam_gripper), points)
        boxes = plan.gripper.boxes(np.array([grasp.opening]), plan.config.approach)[0]
        inside = (local[None] >= boxes[:, None, 0]) & (local[None] <= boxes[:, None, 1])
        count += bool(inside.all(axis=-1).any())
    return count
