"""Scenes in the published layout, small enough to evaluate in a test."""

import json

import numpy as np
import trimesh
from PIL import Image

from brrp_cli.demo.layout import camera_pose
from brrp_cli.geometry import transform_points
from brrp_cli.raycast import look

H, W, FOCAL = 90, 120, 110.0
NEAR, FAR = 0.1, 5.0
K = np.array([[FOCAL, 0, W / 2], [0, FOCAL, H / 2], [0, 0, 1]])
T_GL_CAM = np.diag([1.0, -1.0, -1.0, 1.0])

# All stand on z = 0 and are centred on z, so that a position needs no z.
MESHES = {
    "box": trimesh.creation.box((0.12, 0.10, 0.14)).apply_translation([0, 0, 0.07]),
    "can": trimesh.creation.cylinder(0.055, 0.13, sections=24).apply_translation([0, 0, 0.065]),
    "ball": trimesh.creation.icosphere(3, 0.06).apply_translation([0, 0, 0.06]),
}


def write_meshes(folder):
    """NAME.obj of each of `MESHES`."""
    folder.mkdir(parents=True)
    for name, mesh in MESHES.items():
        mesh.export(folder / f"{name}.obj")
    return folder


def write_scene(folder, objects, yaw=0.5, ghost=None):
    """Objects {id: (name, x, y)} on a table, seen from one view.

    ghost : an id that gets a patch of mask where nothing is seen, which no method can reconstruct.
    """
    view = folder / "0000"
    view.mkdir(parents=True)
    entries = [
        {
            "id": i,
            "mesh_path": f"shapes/{name}.obj",
            "position": [x, y, 0.0],
            "orientation": [0.0, 0.0, 0.0, 1.0],
            "scale": 1.0,
        }
        for i, (name, x, y) in objects.items()
    ]
    if ghost is not None:
        entries.append(entries[0] | {"id": ghost})
    (folder / "objects.json").write_text(json.dumps(entries))

    T_world_cam = camera_pose(np.array([0.0, 0.0, 0.03]), 0.75, 0.6, yaw)
    table = trimesh.creation.box((1.0, 1.0, 0.02)).apply_translation([0, 0, -0.01])
    meshes = [table] + [
        MESHES[name].copy().apply_translation([x, y, 0]) for name, x, y in objects.values()
    ]
    for mesh in meshes:
        mesh.vertices = transform_points(np.linalg.inv(T_world_cam), mesh.vertices)
    sight = look(meshes, K, (H, W))
    ids = np.array([-1, -1, *objects])[sight.index + 1]
    depth = np.where(sight.depth > 0, sight.depth, FAR)
    if ghost is not None:
        ids[:5, :5], depth[:5, :5] = ghost, FAR
    np.save(view / "seg_mask.npy", ids)
    np.save(view / "depth.npy", (FAR / (FAR - NEAR) * (1 - NEAR / depth)).astype(np.float32))
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = 2 * FOCAL / W, 2 * FOCAL / H
    projection[2, 2:] = -(FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)
    projection[3, 2] = -1
    T_gl_world = T_GL_CAM @ np.linalg.inv(T_world_cam)
    np.savez(view / "camera.npz", projection_matrix=projection, view_matrix=T_gl_world)
    Image.new("RGB", (W, H), "white").save(view / "rgb.jpg")
