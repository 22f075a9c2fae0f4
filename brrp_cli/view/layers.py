"""What is drawn of a result: meshes, observed points, collision shapes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.drawing import stored_hands
from brrp_cli.reconstruction import Surface
from brrp_cli.results.read import StoredResult
from brrp_cli.surface.colours import spread

if TYPE_CHECKING:
    import trimesh

# Of what is no object, points further than this from the objects' box are left out, metres.
SURROUNDINGS = 0.25
MOST_POINTS = 120_000
PLAN_SCENE = "plan/scene.glb"


def observed_points(
    stored: StoredResult, object_id: int
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Points (n, 3) of one id, metres, frame of the meshes, and their colours (n, 3); of the
    background those around the objects. Some of them where there are many."""
    frame = stored.frame
    stride = point_stride(frame)
    chosen = np.zeros(frame.shape, dtype=bool)
    chosen[::stride, ::stride] = (frame.valid & (frame.segmap == object_id))[::stride, ::stride]
    points, colours = frame.points[chosen], frame.rgb[chosen]
    if object_id == BACKGROUND:
        objects = frame.points[frame.valid & (frame.segmap != BACKGROUND)]
        if len(objects):
            low, high = objects.min(axis=0) - SURROUNDINGS, objects.max(axis=0) + SURROUNDINGS
            near = ((points >= low) & (points <= high)).all(axis=1)
            points, colours = points[near], colours[near]
    moved = transform_points(stored.T_frame_cam, points)
    return np.asarray(moved, dtype=np.float32), colours


def point_stride(frame: Frame) -> int:
    """Every so many rows and columns are shown, so that they are about `MOST_POINTS` points."""
    return max(1, round(float(np.sqrt(frame.segmap.size / MOST_POINTS))))


def page_glb(stored: StoredResult) -> bytes:
    """One GLB: `object_ID` with its colours and `_spread` on its vertices,
    `points_ID`, `plan_object_ID_part_I` where there are collision shapes, and `grasps_ID` where
    `brrp grasp` found some."""
    import trimesh

    scene = trimesh.Scene()
    for object_id, surface in stored.surfaces.items():
        _add(scene, f"object_{object_id}", _as_mesh(surface))
    for object_id in [BACKGROUND, *stored.frame.object_ids]:
        points, colours = observed_points(stored, object_id)
        if len(points):
            _add(scene, f"points_{object_id}", trimesh.PointCloud(points, colours))
    for name, part in collision_parts(stored).items():
        _add(scene, f"plan_{name}", part)
    for object_id, hands in stored_hands(stored.folder).items():
        _add(scene, f"grasps_{object_id}", hands)
    if not scene.geometry:
        return b""
    return bytes(scene.export(file_type="glb"))


def collision_parts(stored: StoredResult) -> dict[str, trimesh.Trimesh]:
    """The convex parts that `brrp export` wrote into the results, by name, in the frame of the
    meshes."""
    import trimesh

    path: Path = stored.folder / PLAN_SCENE
    if not path.is_file():
        return {}
    scene = trimesh.load_scene(path)
    parts = {}
    for name in scene.graph.nodes_geometry:
        T, geometry = scene.graph[name]
        if name.startswith("object_"):
            parts[str(name)] = scene.geometry[geometry].copy().apply_transform(T)
    return parts


def _as_mesh(surface: Surface) -> trimesh.Trimesh:
    import trimesh

    return trimesh.Trimesh(
        surface.vertices,
        surface.faces,
        vertex_colors=surface.colours,
        vertex_attributes={"_spread": spread(surface).astype(np.float32)},
        process=False,
    )


def _add(scene: trimesh.Scene, name: str, geometry: Any) -> None:
    scene.add_geometry(geometry, node_name=name, geom_name=name)
