"""Throw bytes at the readers of frames, manifests, tables and results, guided by which code they
reach.

A reader may give a result or one of the project's own errors; whatever else comes out of it, or
takes longer than two seconds, is kept in the folder of findings: the input, and the traceback.
The first byte of an input chooses the reader. Needs `pip install '.[fuzz,ros]'`.

    nice python tools/fuzz.py --minutes 30 -o findings/

Ends with 1 if there are findings. `--replay FILE...` runs kept inputs again.
"""

from __future__ import annotations

import argparse
import atexit
import hashlib
import io
import json
import logging
import multiprocessing
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import atheris

# The worker that builds the example needs none of it, and imports this file too.
with (
    nullcontext()
    if multiprocessing.parent_process()
    else atheris.instrument_imports(
        include=[
            "brrp_cli",
            "zipfile",
            "json",
            "numpy.lib",
            "numpy.lib._format_impl",
            "csv",
            "tomllib",
        ]
    )
):
    import numpy as np

    from brrp_cli.errors import BrrpError
    from brrp_cli.evaluation.scenes import find_scenes
    from brrp_cli.evaluation.truth import read_objects
    from brrp_cli.frames.build import make_frame
    from brrp_cli.frames.intrinsics import read_intrinsics
    from brrp_cli.frames.npz import load_frame
    from brrp_cli.frames.pixels import read_colour, read_depth, read_masks
    from brrp_cli.frames.readers import read_frame
    from brrp_cli.frames.ros_images import frame_of
    from brrp_cli.prior.descriptions import read_descriptions
    from brrp_cli.prior.index import INDEX_FILE, index_of, read_index
    from brrp_cli.prior.manifest import FILE, parse_manifest
    from brrp_cli.prior.shard import object_names, open_shard, read_stored
    from brrp_cli.retrieval.table import TableRetriever
    from brrp_cli.surface.stored import open_result

SLOW = 2.0
MAX_BYTES = 20_000
DTYPES = ("<f4", "<f8", "<u2", "|u1", "<i8", "<f2", "|b1", "<c8", "<U3", "<M8[s]", ">f4", ">u2")
WORK = Path(tempfile.mkdtemp(prefix="brrp_fuzz_"))
atexit.register(shutil.rmtree, WORK, ignore_errors=True)
# Folders of frames: what is read, and the files that inputs stand in for, one at a time.
FOLDERS = {
    "bop": ("scene_camera.json", "scene_gt.json"),
    "freiburg1": ("rgb.txt", "depth.txt", "groundtruth.txt"),
    "view/0000": ("../objects.json", "depth.npy", "camera.npz", "seg_mask.npy"),
    "real": ("xyz.npy", "segmentation.npy"),
    "recording": ("camera_intrinsic.json", "depth/000000.png"),
}
REPLACED = [(folder, name) for folder, names in FOLDERS.items() for name in names]
ENCODINGS = ("rgb8", "bgra8", "mono8", "16UC1", "32FC1", "mono16", "8UC3", "bayer")


def written(data: bytes, name: str) -> Path:
    """A file with these bytes."""
    path = WORK / name
    path.write_bytes(data)
    return path


def npz(data: bytes) -> None:
    """A frame file of any bytes."""
    finite(load_frame(written(data, "frame.npz"), masks=False))


def arrays(data: bytes) -> None:
    """Arrays of drawn types, shapes and values, as a caller of `make_frame` has them."""
    draw = atheris.FuzzedDataProvider(data)
    height, width = draw.ConsumeIntInRange(1, 6), draw.ConsumeIntInRange(1, 6)
    given = {}
    for name, shape in {
        "depth": (height, width),
        "xyz": (height, width, 3),
        "segmap": (height, width),
        "rgb": (height, width, 3),
        "K": (3, 3),
        "T_world_cam": (4, 4),
    }.items():
        if not draw.ConsumeBool():
            continue
        if draw.ConsumeIntInRange(0, 9) == 0:
            shape = tuple(draw.ConsumeIntInRange(0, 4) for _ in range(draw.ConsumeIntInRange(0, 4)))
        kind = np.dtype(DTYPES[draw.ConsumeIntInRange(0, len(DTYPES) - 1)])
        count = int(np.prod(shape))
        raw = draw.ConsumeBytes(count * kind.itemsize).ljust(count * kind.itemsize, b"\x01")
        if kind.kind == "U":
            given[name] = np.full(shape, "far")
        elif name in ("K", "T_world_cam") and draw.ConsumeBool():
            given[name] = np.diag([50.0, 50, 1]) if name == "K" else np.eye(4)
        elif kind.kind == "f" and draw.ConsumeBool():
            given[name] = np.frombuffer(raw, np.uint8)[:count].reshape(shape) / 50
        else:
            given[name] = np.frombuffer(raw, kind).reshape(shape)
    scale = draw.ConsumeFloat() if draw.ConsumeBool() else None
    finite(
        make_frame(given.pop("rgb", None), given.pop("segmap", None), **given, depth_scale=scale)
    )


def finite(frame) -> None:  # type: ignore[no-untyped-def]
    """What a frame promises to those that read it."""
    assert np.isfinite(frame.points[frame.valid]).all()
    assert frame.shape == frame.points.shape[:2] == frame.rgb.shape[:2]
    assert np.isfinite(frame.K).all()


def intrinsics(data: bytes) -> None:
    """A camera's JSON."""
    read_intrinsics(written(data, "k.json"))


def manifest(data: bytes) -> None:
    """A prior's manifest, and what follows from it."""
    found = parse_manifest(data, WORK / FILE)
    found.as_bytes()
    index_of(found, "0" * 64).as_bytes()


def index(data: bytes) -> None:
    """An index beside a manifest, with its sum in order, so that its table is reached."""
    folder = WORK / "prior"
    folder.mkdir(exist_ok=True)
    (folder / FILE).write_bytes(MANIFEST)
    digest = hashlib.sha256(MANIFEST).hexdigest().encode()
    line = data.replace(b"\n", b" ").replace(b"DIGEST", digest)
    (folder / INDEX_FILE).write_bytes(
        hashlib.sha256(line).hexdigest().encode() + b"\n" + line + b"\n"
    )
    found = read_index(folder)
    for name in found.names:
        assert found.shards[found.shard_of[found.rows[name]]].file


def shard(data: bytes) -> None:
    """An HDF5 file that may be a shard."""
    with open_shard(written(data, "shard.h5")) as file:
        for name in object_names(file):
            read_stored(file, name)


def tables(data: bytes) -> None:
    """Tables of probabilities, descriptions, true objects."""
    draw = {0: "csv", 1: "json", 2: "toml"}.get(data[0] % 3 if data else 0)
    path = written(data[1:], f"table.{draw}")
    for read in (
        lambda: TableRetriever(path, ["cup", "bowl"]),
        lambda: read_descriptions(path),
        lambda: read_objects(path),
    ):
        try:
            read()
        except BrrpError:
            continue


def images(data: bytes) -> None:
    """Images of colour, depth and masks."""
    path = written(data, "image.png")
    for read in (read_colour, read_depth, read_masks):
        try:
            read(path)
        except BrrpError:
            continue


def folders(data: bytes) -> None:
    """A folder of frames of which one file is any bytes, as a frame and as scenes with truth."""
    folder, name = REPLACED[data[0] % len(REPLACED)] if data else REPLACED[0]
    path = WORK / folder / name
    whole = path.read_bytes()
    path.write_bytes(data[1:])
    try:
        for read in (
            lambda: finite(read_frame(WORK / folder)),
            lambda: [finite(s.view(0)) for s in find_scenes(WORK / folder.removesuffix("/0000"))],
        ):
            try:
                read()
            except BrrpError:
                continue
    finally:
        path.write_bytes(whole)


def messages(data: bytes) -> None:
    """Image messages of ROS with drawn sizes, encodings and bytes."""
    draw = atheris.FuzzedDataProvider(data)

    def image() -> SimpleNamespace:
        if draw.ConsumeBool():
            kind = ("jpeg", "16UC1; compressedDepth png", "32FC1")[draw.ConsumeIntInRange(0, 2)]
            raw = draw.ConsumeBytes(draw.ConsumeIntInRange(0, 400))
            return SimpleNamespace(format=kind, data=raw)
        return SimpleNamespace(
            encoding=ENCODINGS[draw.ConsumeIntInRange(0, len(ENCODINGS) - 1)],
            height=draw.ConsumeIntInRange(0, 6),
            width=draw.ConsumeIntInRange(0, 6),
            step=draw.ConsumeIntInRange(0, 40),
            is_bigendian=draw.ConsumeBool(),
            data=draw.ConsumeBytes(draw.ConsumeIntInRange(0, 240)),
        )

    numbers = [draw.ConsumeFloat() if draw.ConsumeBool() else float(i == 0) for i in range(9)]
    info = SimpleNamespace(
        k=numbers, height=draw.ConsumeIntInRange(0, 6), width=draw.ConsumeIntInRange(0, 6)
    )
    finite(frame_of(image(), image(), info))


def bag(data: bytes) -> None:
    """A ROS 1 bag."""
    finite(read_frame(written(data, "a.bag")))


def results(data: bytes) -> None:
    """A record of results."""
    (WORK / "out").mkdir(exist_ok=True)
    written(b"", "out/frame.npz")
    written(data, "out/result.json")
    stored = open_result(WORK / "out")
    assert np.isfinite(stored.T_frame_cam).all()
    assert stored.plane is None or np.isfinite(stored.plane.normal).all()
    assert stored.surface_config and sorted(stored.object_ids)


READERS: list[Callable[[bytes], None]] = [
    npz,
    arrays,
    intrinsics,
    manifest,
    index,
    shard,
    tables,
    images,
    folders,
    messages,
    bag,
    results,
]


def seeds() -> dict[str, list[bytes]]:
    """Good inputs by reader, from which the search starts."""
    from PIL import Image

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
        "manifest": [MANIFEST],
        "index": [INDEX],
        "shard": [SHARD],
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


def examples() -> tuple[bytes, bytes, bytes]:
    """The manifest, the index with its digest left open, and a shard of a small prior."""
    import trimesh

    from brrp_cli.config import FeatureConfig
    from brrp_cli.prior.build import build_prior
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
    build_prior(meshes, WORK / "example", tiny, workers=1)
    folder = WORK / "example"
    line = (folder / INDEX_FILE).read_bytes().split(b"\n")[1]
    data = (folder / FILE).read_bytes()
    (made,) = (folder / "shards").iterdir()
    digest = hashlib.sha256(data).hexdigest().encode()
    return data, line.replace(digest, b"DIGEST"), made.read_bytes()


def one(data: bytes, findings: Path) -> None:
    """One input; what nobody foresaw is kept."""
    if not data:
        return
    reader = READERS[data[0] % len(READERS)]
    start = time.process_time()
    told = ""
    try:
        reader(data[1:])
    except BrrpError as error:
        str(error)
    except Exception:
        told = traceback.format_exc()
    if time.process_time() - start > SLOW:
        told += f"{reader.__name__} took {time.process_time() - start:.1f} s of processor time\n"
    if not told:
        return
    # One of a kind: where it came up, and what it is.
    lines = [line for line in told.splitlines() if line.startswith("  File") or line[:1].isalpha()]
    kind = hashlib.sha256("\n".join([*lines[-4:-1], lines[-1].split(":")[0]]).encode()).hexdigest()
    path = findings / f"{reader.__name__}-{kind[:12]}"
    if not path.exists():
        path.write_bytes(data)
        path.with_suffix(".txt").write_text(told)
        print(f"found: {path}: {lines[-1][:200]}", flush=True)


def main() -> None:
    """Fuzz, or run kept inputs again."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--findings", type=Path, default=Path("findings"))
    parser.add_argument("--replay", type=Path, nargs="+")
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    options.findings.mkdir(parents=True, exist_ok=True)
    global MANIFEST, INDEX, SHARD
    MANIFEST, INDEX, SHARD = examples()
    make_folders()
    if options.replay:
        for path in options.replay:
            one(path.read_bytes(), options.findings)
        return
    corpus = options.findings / "corpus"
    corpus.mkdir(exist_ok=True)
    first = seeds()
    for number, reader in enumerate(READERS):
        for i, data in enumerate(first[reader.__name__]):
            (corpus / f"{reader.__name__}-{i}").write_bytes(bytes([number]) + data)
    arguments = [
        sys.argv[0],
        f"-max_total_time={round(60 * options.minutes)}",
        f"-max_len={MAX_BYTES}",
        f"-seed={options.seed}",
        "-rss_limit_mb=3000",
        "-timeout=30",
        f"-artifact_prefix={options.findings}/",
        "-print_final_stats=1",
        str(corpus),
    ]
    atheris.Setup(arguments, lambda data: one(data, options.findings))
    atheris.Fuzz()


if __name__ == "__main__":
    main()
