"""Good inputs, from which the search starts: six pixels square, and a prior of one box."""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path

import numpy as np

from brrp_cli.prior.index import INDEX_FILE
from brrp_cli.prior.manifest import FILE
from fuzzing.place import FOLDERS, PRIOR, REPLACED, WORK

RECORD = {
    "schema": 1,
    "brrp": "0.1.0",
    "frame": "camera",
    "T_frame_cam": np.eye(4).tolist(),
    "method": "brrp",
    "plane_cam": {"normal": [0.0, -1.0, 0.0], "offset": 0.5},
    "config": {"surface": {"level": 0.4}},
    "objects": [
        {"id": 7, "status": "ok", "message": "", "mesh": "object_7.ply", "uncertainty_unit": "x"},
        {"id": 8, "status": "no_surface", "message": "none", "mesh": None},
    ],
}


def first_inputs() -> dict[str, list[bytes]]:
    """Good inputs by reader, from which the search starts; makes the place that readers look at."""
    from PIL import Image

    make_folders()
    manifest, index, shard = small_prior()
    stream, picture = io.BytesIO(), io.BytesIO()
    K = np.diag([50.0, 50, 1])
    depth, mask = np.full((6, 6), 800, np.uint16), np.eye(6, dtype=np.uint8)
    rgb = np.zeros((6, 6, 3), np.uint8)
    np.savez(stream, depth=depth, K=K, segmap=mask, rgb=rgb, T_world_cam=np.eye(4))
    small = io.BytesIO()
    np.savez_compressed(small, depth=depth.astype(np.float32) / 1000, K=K, seg=mask)
    Image.fromarray(depth).save(picture, "PNG")
    table = {"0": {"cup": 0.5, "bowl": 0.25}}
    truth = [{"id": 1, "mesh_path": "a.obj", "position": [0, 0, 0], "orientation": [0, 0, 0, 1]}]
    return {
        "npz": [stream.getvalue(), small.getvalue()],
        "arrays": [bytes(range(256)) * 4, b"\xff" * 600],
        "intrinsics": [
            b'{"fx": 50, "fy": 50, "cx": 3, "cy": 3, "width": 6, "height": 6}',
            json.dumps({"color": {"K": K.ravel().tolist(), "D": [0, 1]}}).encode(),
            json.dumps({"intrinsic_matrix": K.tolist(), "depth_scale": 0.001}).encode(),
        ],
        "manifest": [manifest],
        "index": [index],
        "shard": [shard],
        "tables": [
            b"\x00object,name,probability\n0,cup,0.5\n",
            b"\x01" + json.dumps(table).encode(),
            b"\x01" + json.dumps(truth).encode(),
            b'\x02[descriptions]\ncup = "a cup"\n',
        ],
        "images": [picture.getvalue()],
        "folders": [
            bytes([i]) + (WORK / folder / name).read_bytes()
            for i, (folder, name) in enumerate(REPLACED)
        ],
        "messages": [bytes(range(256)) * 3, b"\x00" * 700, b"\x01\x03\x06" * 200],
        "bag": [small_bag()],
        "results": [json.dumps(RECORD).encode()],
    }


def small_bag() -> bytes:
    """One colour image, one depth image and their camera_info."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    types, time_type = store.types, store.types["builtin_interfaces/msg/Time"]
    header = types["std_msgs/msg/Header"](seq=0, stamp=time_type(sec=1, nanosec=0), frame_id="c")

    def image(encoding: str, size: int) -> object:
        return types["sensor_msgs/msg/Image"](
            header=header, height=6, width=6, encoding=encoding, is_bigendian=0, step=6 * size,
            data=np.full(36 * size, 3, np.uint8),
        )  # fmt: skip

    roi = types["sensor_msgs/msg/RegionOfInterest"](
        x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
    )
    info = types["sensor_msgs/msg/CameraInfo"](
        header=header, height=6, width=6, distortion_model="", D=np.zeros(5),
        K=np.array([50.0, 0, 3, 0, 50, 3, 0, 0, 1]), R=np.zeros(9), P=np.zeros(12),
        binning_x=0, binning_y=0, roi=roi,
    )  # fmt: skip
    path = WORK / "small.bag"
    with Writer(path) as writer:
        for topic, kind, message in (
            ("/c/color/camera_info", "sensor_msgs/msg/CameraInfo", info),
            ("/c/color/image", "sensor_msgs/msg/Image", image("rgb8", 3)),
            ("/c/depth/image", "sensor_msgs/msg/Image", image("16UC1", 2)),
        ):
            connection = writer.add_connection(topic, kind, typestore=store)
            writer.write(connection, 10**9, store.serialize_ros1(message, kind))
    return path.read_bytes()


def make_folders() -> None:
    """Frames of 6 x 6 pixels in the layouts of `FOLDERS`."""
    from PIL import Image

    K = np.array([[50.0, 0, 3], [0, 50, 3], [0, 0, 1]])
    rgb, depth = np.zeros((6, 6, 3), np.uint8), np.full((6, 6), 800, np.uint16)
    ids = np.eye(6, dtype=np.uint8)
    bop, tum, view, real, recording = (WORK / name for name in FOLDERS)

    def save(array: np.ndarray, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".npy":
            np.save(path, array)
        else:
            Image.fromarray(array).save(path)

    (WORK / "models").mkdir()
    save(rgb, bop / "rgb/000003.png")
    save(depth, bop / "depth/000003.png")
    save(ids * 255, bop / "mask_visib/000003_000000.png")
    turn = np.eye(3).ravel().tolist()
    camera = {"cam_K": K.ravel().tolist(), "depth_scale": 1.0}
    camera |= {"cam_R_w2c": turn, "cam_t_w2c": [0, 0, 700.0]}
    truth = [{"obj_id": 1, "cam_R_m2c": turn, "cam_t_m2c": [0, 0, 700.0]}]
    (bop / "scene_camera.json").write_text(json.dumps({"3": camera}))
    (bop / "scene_gt.json").write_text(json.dumps({"3": truth}))

    save(rgb, tum / "rgb/1.5.png")
    save((depth * 5), tum / "depth/1.49.png")
    (tum / "rgb.txt").write_text("# colour\n1.5 rgb/1.5.png\n")
    (tum / "depth.txt").write_text("1.49 depth/1.49.png\n")
    (tum / "groundtruth.txt").write_text("1.501 1.5 0.25 1 0 0 0.7071 0.7071\n")

    save(rgb, view / "rgb.jpg")
    save(np.full((6, 6), 0.9, np.float32), view / "depth.npy")
    save(ids, view / "seg_mask.npy")
    projection = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1.02, -0.2], [0, 0, -1, 0]])
    np.savez(view / "camera.npz", projection_matrix=projection, view_matrix=np.eye(4))
    entry = {"id": 1, "mesh_path": "a.obj", "position": [0, 0, 0], "orientation": [0, 0, 0, 1]}
    (view.parent / "objects.json").write_text(json.dumps([{**entry, "scale": [1, 1, 1]}]))

    z = np.full((6, 6), 0.8, np.float32)
    rows, columns = np.mgrid[:6, :6]
    xyz = np.stack([(columns - 3) / 50 * z, (rows - 3) / 50 * z, z], axis=-1)
    save(rgb, real / "rgb.jpg")
    save(xyz.astype(np.float32), real / "xyz.npy")
    save(ids, real / "segmentation.npy")

    save(rgb, recording / "color/000000.jpg")
    save(depth, recording / "depth/000000.png")
    matrix = {"width": 6, "height": 6, "intrinsic_matrix": K.T.ravel().tolist()}
    (recording / "camera_intrinsic.json").write_text(json.dumps(matrix))


def small_prior() -> tuple[bytes, bytes, bytes]:
    """The manifest, the index with its digest left open, and a shard of a small prior."""
    import trimesh

    from brrp_cli.config import FeatureConfig
    from brrp_cli.prior.build.build import build_prior
    from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters, FieldConfig

    tiny = BuildParameters(
        samples=50,
        surface_points=20,
        dense_points=300,
        features=FeatureConfig(scales=(0.5,), voxel=0.03),
        appearance=AppearanceConfig(views=1, rays=50),
        distances=FieldConfig(nodes=50),
    )
    meshes = WORK / "meshes"
    meshes.mkdir()
    trimesh.creation.box((0.1, 0.06, 0.04)).export(meshes / "box.stl")
    build_prior(meshes, PRIOR, tiny, workers=1)
    line = (PRIOR / INDEX_FILE).read_bytes().split(b"\n")[1]
    data = (PRIOR / FILE).read_bytes()
    (made,) = (PRIOR / "shards").iterdir()
    digest = hashlib.sha256(data).hexdigest().encode()
    return data, line.replace(digest, b"DIGEST"), made.read_bytes()
