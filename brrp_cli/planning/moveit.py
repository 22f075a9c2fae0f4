"""A planning scene for MoveIt: as its text file, and as the message moveit_msgs/PlanningScene.

The text is what PlanningScene::saveGeometryToStream writes and loadGeometryFromStream, RViz's
"Import" and moveit_publish_scene_from_text read, in the layout since MoveIt 1.1, which has a pose
and subframes for each object:

    NAME
    * OBJECT
    x y z                   pose of the object
    qx qy qz qw
    COUNT                   shapes
    box | mesh              its name, then its sizes; of a mesh "VERTICES TRIANGLES", one a line
    ...
    x y z                   pose of the shape in the object
    qx qy qz qw
    r g b a                 0 to 1
    COUNT                   subframes
    NAME, x y z, qx qy qz qw    a line each
    .

The message holds the fields that differ from their defaults, which is what
rosidl_runtime_py.set_message_fields takes; `operation` is by default ADD.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.planning.body import Body
from brrp_cli.planning.mjcf import FURNITURE_COLOUR, TABLE_COLOUR, TableBox
from brrp_cli.planning.numbers import quaternion_wxyz, spell

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]
NAME, TABLE = "brrp", "table"
# shape_msgs/SolidPrimitive
BOX = 1
# By object, its named frames in the frame of the results, (4, 4) each, the best grasp first.
Subframes = Mapping[str, Sequence[tuple[str, Array]]]


def scene_text(bodies: Mapping[str, Body], table: TableBox | None, subframes: Subframes) -> str:
    """A `.scene` file, metres, frame of the results: each body, bin and wall as its convex
    parts, the table as a box.

    subframes : of bodies, by name
    """
    lines = [NAME]
    if table is not None:
        size = ["box", spell(table.size)]
        shape = [*size, *_pose_lines(np.eye(4)), spell(TABLE_COLOUR)]
        lines += [f"* {TABLE}", *_pose_lines(table.T_frame_table), "1", *shape, "0"]
    for name, walls in _furniture(table):
        lines += [*_part_lines(name, np.eye(4), FURNITURE_COLOUR, walls), "0"]
    for name, body in bodies.items():
        lines += _part_lines(name, body.T_frame_body, body.colour, body.parts)
        frames = _in_body(body, subframes.get(name, ()))
        lines.append(str(len(frames)))
        for frame, T in frames:
            lines += [frame, *_pose_lines(T)]
    return "\n".join([*lines, "."]) + "\n"


def _part_lines(name: str, T: Array, colour: Iterable[float], parts: Sequence[Array]) -> list[str]:
    lines = [f"* {name}", *_pose_lines(T), str(len(parts))]
    for part in parts:
        hull = _hull(part)
        lines += ["mesh", f"{len(hull.vertices)} {len(hull.faces)}"]
        lines += [spell(vertex) for vertex in hull.vertices]
        lines += [f"{a} {b} {c}" for a, b, c in hull.faces]
        lines += [*_pose_lines(np.eye(4)), spell([*colour, 1.0])]
    return lines


def planning_scene(
    bodies: Mapping[str, Body], table: TableBox | None, subframes: Subframes, frame_id: str
) -> dict[str, Any]:
    """moveit_msgs/PlanningScene, a diff, of the same, with poses in `frame_id`."""
    objects: list[dict[str, Any]] = []
    colours: dict[str, Sequence[float]] = {}
    if table is not None:
        objects.append(
            _object(TABLE, table.T_frame_table, frame_id)
            | {
                "primitives": [{"type": BOX, "dimensions": _numbers(table.size)}],
                "primitive_poses": [pose(np.eye(4))],
            }
        )
        colours[TABLE] = TABLE_COLOUR
    for name, walls in _furniture(table):
        objects.append(_object(name, np.eye(4), frame_id) | _meshes(walls))
        colours[name] = (*FURNITURE_COLOUR, 1.0)
    for name, body in bodies.items():
        frames = _in_body(body, subframes.get(name, ()))
        objects.append(
            _object(name, body.T_frame_body, frame_id)
            | _meshes(body.parts)
            | {
                "subframe_names": [frame for frame, _ in frames],
                "subframe_poses": [pose(T) for _, T in frames],
            }
        )
        colours[name] = (*(float(c) for c in body.colour), 1.0)
    return {
        "name": NAME,
        "is_diff": True,
        # Without it the diff would set the robot's state to nothing.
        "robot_state": {"is_diff": True},
        "world": {"collision_objects": objects},
        "object_colors": [
            {"id": name, "color": dict(zip("rgba", _numbers(colour), strict=True))}
            for name, colour in colours.items()
        ],
    }


def pose(T: Array) -> dict[str, Any]:
    """geometry_msgs/Pose of T (4, 4)."""
    w, x, y, z = quaternion_wxyz(T[:3, :3])
    return {
        "position": dict(zip("xyz", _numbers(T[:3, 3]), strict=True)),
        "orientation": dict(zip("xyzw", _numbers([x, y, z, w]), strict=True)),
    }


def _object(name: str, T: Array, frame_id: str) -> dict[str, Any]:
    return {"header": {"frame_id": frame_id}, "id": name, "pose": pose(T)}


def _furniture(table: TableBox | None) -> Iterable[tuple[str, Sequence[Array]]]:
    return () if table is None else table.furniture.items()


def _meshes(parts: Sequence[Array]) -> dict[str, Any]:
    return {
        "meshes": [_mesh(_hull(part)) for part in parts],
        "mesh_poses": [pose(np.eye(4)) for _ in parts],
    }


def _mesh(hull: trimesh.Trimesh) -> dict[str, Any]:
    """shape_msgs/Mesh."""
    return {
        "triangles": [{"vertex_indices": [int(i) for i in face]} for face in hull.faces],
        "vertices": [dict(zip("xyz", _numbers(v), strict=True)) for v in hull.vertices],
    }


def _hull(part: Array) -> trimesh.Trimesh:
    import trimesh

    return trimesh.convex.convex_hull(part)


def _in_body(body: Body, frames: Sequence[tuple[str, Array]]) -> list[tuple[str, Array]]:
    T_body_frame = np.linalg.inv(body.T_frame_body)
    return [(name, T_body_frame @ T) for name, T in frames]


def _pose_lines(T: Array) -> list[str]:
    w, x, y, z = quaternion_wxyz(T[:3, :3])
    return [spell(T[:3, 3]), spell([x, y, z, w])]


def _numbers(values: Sequence[float] | Array) -> list[float]:
    return [float(f"{float(value):.9g}") for value in values]
