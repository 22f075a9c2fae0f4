"""Hands as meshes, coloured by their score, for pages and scenes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from brrp_cli.files import parse_json
from brrp_cli.grasping.gripper import Gripper
from brrp_cli.grasping.record import RECORD, SCHEMA, grasps_record

if TYPE_CHECKING:
    import trimesh

    from brrp_cli.grasping.grasp import GraspPlan

# Of each object: more hide it and one another.
DRAWN = 5
# A hand is drawn as bars this thick, metres: what is behind it still shows.
THICK = 0.004
COLOURS = "RdYlGn"
# What reading JSON of another making ends in.
_DAMAGE = (
    OSError,
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    IndexError,
    OverflowError,
    StopIteration,
)


def hands_by_object(record: Mapping[str, Any]) -> dict[int, trimesh.Trimesh]:
    """The best hands of each object of a record as one mesh, in the record's frame, red (score 0)
    to green (1)."""
    import trimesh

    table = {key: value for key, value in record["gripper"].items() if key != "tip"}
    gripper = Gripper(**table)
    key = next(f"T_{name}_gripper" for name in ("cam", "world") if record["frame"].startswith(name))
    found = {}
    for item in record["objects"]:
        hands = [
            _hand(gripper, np.array(grasp[key]), grasp["opening"], grasp["score"])
            for grasp in item["grasps"][:DRAWN]
        ]
        if hands:
            found[int(item["id"])] = cast("trimesh.Trimesh", trimesh.util.concatenate(hands))
    return found


def stored_hands(folder: Path) -> dict[int, trimesh.Trimesh]:
    """The same of the grasps.json in a folder of results; none where there is none that can be
    read."""
    try:
        record = parse_json((folder / RECORD).read_text(encoding="utf-8"))
        if record["schema"] != SCHEMA:
            return {}
        return hands_by_object(record)
    except _DAMAGE:
        return {}


def save_glb(plan: GraspPlan, path: Path, frame: str, T_frame_cam: Any) -> None:
    """One GLB of `grasps_ID`, metres, frame of the results; an empty scene cannot be exported, so
    that there is no file without a grasp."""
    import trimesh

    scene = trimesh.Scene()
    for object_id, mesh in hands_by_object(grasps_record(plan, frame, T_frame_cam)).items():
        name = f"grasps_{object_id}"
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    if scene.geometry:
        path.write_bytes(scene.export(file_type="glb"))


def _hand(gripper: Gripper, T: np.ndarray, opening: float, score: float) -> trimesh.Trimesh:
    """Two fingers, what joins them, and the wrist, as bars."""
    import matplotlib
    import trimesh

    half = opening / 2 + THICK / 2
    root, tip = gripper.palm_length, gripper.tip
    bars = [((x, 0, root), (x, 0, tip)) for x in (-half, half)]
    bars += [((-half, 0, root), (half, 0, root)), ((0, 0, root - 0.03), (0, 0, root))]
    parts = []
    for start, end in bars:
        low, high = np.minimum(start, end), np.maximum(start, end)
        size = high - low + THICK
        parts.append(trimesh.creation.box(size).apply_translation((low + high) / 2))
    mesh = trimesh.util.concatenate(parts).apply_transform(T)
    colour = matplotlib.colormaps[COLOURS](float(np.clip(score, 0, 1)))
    mesh.visual.vertex_colors = np.tile(np.array(colour) * 255, (len(mesh.vertices), 1)).astype(
        "u1"
    )
    return mesh
