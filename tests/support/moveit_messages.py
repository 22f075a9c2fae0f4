"""MoveIt's files read back.

Messages are moveit_msgs as rosbags builds them of their published fields
(github.com/moveit/moveit_msgs, branch ros2), filled with what a JSON holds. A `.scene` file is read
token by token, as PlanningScene::loadGeometryFromStream does it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

FIELDS = {
    "moveit_msgs/msg/PlanningScene": """
        string name
        moveit_msgs/RobotState robot_state
        string robot_model_name
        geometry_msgs/TransformStamped[] fixed_frame_transforms
        moveit_msgs/AllowedCollisionMatrix allowed_collision_matrix
        moveit_msgs/LinkPadding[] link_padding
        moveit_msgs/LinkScale[] link_scale
        moveit_msgs/ObjectColor[] object_colors
        moveit_msgs/PlanningSceneWorld world
        bool is_diff""",
    "moveit_msgs/msg/RobotState": """
        sensor_msgs/JointState joint_state
        sensor_msgs/MultiDOFJointState multi_dof_joint_state
        moveit_msgs/AttachedCollisionObject[] attached_collision_objects
        bool is_diff""",
    "moveit_msgs/msg/AttachedCollisionObject": """
        string link_name
        moveit_msgs/CollisionObject object
        string[] touch_links
        trajectory_msgs/JointTrajectory detach_posture
        float64 weight""",
    "moveit_msgs/msg/CollisionObject": """
        std_msgs/Header header
        geometry_msgs/Pose pose
        string id
        object_recognition_msgs/ObjectType type
        shape_msgs/SolidPrimitive[] primitives
        geometry_msgs/Pose[] primitive_poses
        shape_msgs/Mesh[] meshes
        geometry_msgs/Pose[] mesh_poses
        shape_msgs/Plane[] planes
        geometry_msgs/Pose[] plane_poses
        string[] subframe_names
        geometry_msgs/Pose[] subframe_poses
        byte operation""",
    "object_recognition_msgs/msg/ObjectType": "string key\nstring db",
    "moveit_msgs/msg/AllowedCollisionMatrix": """
        string[] entry_names
        moveit_msgs/AllowedCollisionEntry[] entry_values
        string[] default_entry_names
        bool[] default_entry_values""",
    "moveit_msgs/msg/AllowedCollisionEntry": "bool[] enabled",
    "moveit_msgs/msg/LinkPadding": "string link_name\nfloat64 padding",
    "moveit_msgs/msg/LinkScale": "string link_name\nfloat64 scale",
    "moveit_msgs/msg/ObjectColor": "string id\nstd_msgs/ColorRGBA color",
    "moveit_msgs/msg/PlanningSceneWorld": """
        moveit_msgs/CollisionObject[] collision_objects
        octomap_msgs/OctomapWithPose octomap""",
    "octomap_msgs/msg/OctomapWithPose": """
        std_msgs/Header header
        geometry_msgs/Pose origin
        octomap_msgs/Octomap octomap""",
    "octomap_msgs/msg/Octomap": """
        std_msgs/Header header
        bool binary
        string id
        float64 resolution
        int8[] data""",
    "moveit_msgs/msg/Grasp": """
        string id
        trajectory_msgs/JointTrajectory pre_grasp_posture
        trajectory_msgs/JointTrajectory grasp_posture
        geometry_msgs/PoseStamped grasp_pose
        float64 grasp_quality
        moveit_msgs/GripperTranslation pre_grasp_approach
        moveit_msgs/GripperTranslation post_grasp_retreat
        moveit_msgs/GripperTranslation post_place_retreat
        float32 max_contact_force
        string[] allowed_touch_objects""",
    "moveit_msgs/msg/GripperTranslation": """
        geometry_msgs/Vector3Stamped direction
        float32 desired_distance
        float32 min_distance""",
}


def message(name: str, values: dict[str, Any]) -> Any:
    """`values` as that message, written as CDR and read back. Errors: KeyError for a field that the
    message lacks, whatever rosbags raises for a value of another type."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    found = {}
    for kind, text in FIELDS.items():
        found.update(get_types_from_msg(text, kind))
    store.register(found)
    return store.deserialize_cdr(store.serialize_cdr(_filled(store, name, values), name), name)


def _filled(store: Any, name: str, values: dict[str, Any]) -> Any:
    fields = dict(store.fielddefs[name][1])
    if set(values) - set(fields):
        raise KeyError(f"{name} has no {sorted(set(values) - set(fields))}")
    told = {key: _value(store, kind, values.get(key)) for key, kind in fields.items()}
    return store.types[name](**told)


def _value(store: Any, kind: tuple[Any, Any], value: Any) -> Any:
    node, of = int(kind[0]), kind[1]
    if node == 1:
        plain = of[0]
        default = "" if plain == "string" else False if plain == "bool" else 0
        return default if value is None else value
    if node == 2:
        return _filled(store, of, value or {})
    items = [0] * of[1] if value is None and node == 3 else value or []
    if int(of[0][0]) == 1 and of[0][1][0] != "string":
        plain = {"byte": "uint8", "octet": "uint8"}.get(of[0][1][0], of[0][1][0])
        return np.array(items, dtype=plain)
    return [_value(store, of[0], item) for item in items]


@dataclass
class SceneObject:
    """T (4, 4) of the object; shapes, boxes and meshes, in the object's frame; colours; subframes,
    (4, 4) in the object's frame."""

    T: np.ndarray
    shapes: list[trimesh.Trimesh] = field(default_factory=list)
    colours: list[list[float]] = field(default_factory=list)
    subframes: dict[str, np.ndarray] = field(default_factory=dict)


def read_scene(text: str) -> tuple[str, dict[str, SceneObject]]:
    """Its name, and its objects by name."""
    name, _, rest = text.partition("\n")
    assert " " in rest.split("\n")[1], "the layout before MoveIt 1.1 has no pose here"
    found: dict[str, SceneObject] = {}
    while True:
        marker, _, rest = rest.lstrip().partition(" ")
        if marker.strip() == ".":
            assert not rest.strip()
            return name, found
        assert marker == "*", marker
        line, _, rest = rest.partition("\n")
        # Until the next line that starts with a marker.
        ends = [i for i in (rest.find("\n* "), rest.find("\n.\n")) if i >= 0]
        words, rest = iter(rest[: min(ends)].split()), rest[min(ends) :]
        item = SceneObject(_pose(words))
        for _ in range(int(next(words))):
            shape = _shape(words)
            shape.apply_transform(_pose(words))
            item.shapes.append(shape)
            item.colours.append([float(next(words)) for _ in range(4)])
        for _ in range(int(next(words))):
            key = next(words)
            item.subframes[key] = _pose(words)
        assert next(words, None) is None
        found[line.strip()] = item


def _shape(words: Any) -> trimesh.Trimesh:
    kind = next(words)
    if kind == "box":
        return trimesh.creation.box([float(next(words)) for _ in range(3)])
    assert kind == "mesh", kind
    vertices, faces = int(next(words)), int(next(words))
    corners = np.array([float(next(words)) for _ in range(3 * vertices)]).reshape(-1, 3)
    return trimesh.Trimesh(
        corners,
        np.array([int(next(words)) for _ in range(3 * faces)]).reshape(-1, 3),
        process=False,
    )


def _pose(words: Any) -> np.ndarray:
    x, y, z, qx, qy, qz, qw = (float(next(words)) for _ in range(7))
    T = trimesh.transformations.quaternion_matrix([qw, qx, qy, qz])
    T[:3, 3] = x, y, z
    return T


def pose_matrix(pose: Any) -> np.ndarray:
    """(4, 4) of a geometry_msgs/Pose."""
    p, q = pose.position, pose.orientation
    return _pose(iter([p.x, p.y, p.z, q.x, q.y, q.z, q.w]))
