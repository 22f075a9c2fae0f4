"""The readers of everything that comes from outside, each as a function of bytes.

Each may give a result or one of the project's own errors.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from types import SimpleNamespace

import atheris
import numpy as np

from brrp_cli.api import open_result
from brrp_cli.errors import BrrpError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.intrinsics import read_intrinsics
from brrp_cli.frames.npz import load_frame
from brrp_cli.frames.pixels import read_colour, read_depth, read_masks
from brrp_cli.frames.readers import read_frame
from brrp_cli.frames.ros_images import frame_of
from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.ground_truth.truth import read_objects
from brrp_cli.prior.build.descriptions import read_descriptions
from brrp_cli.prior.index import INDEX_FILE, index_of, read_index
from brrp_cli.prior.manifest import FILE, parse_manifest
from brrp_cli.prior.shard import object_names, open_shard, read_stored
from brrp_cli.retrieval.table import TableRetriever
from fuzzing.place import PRIOR, REPLACED, WORK, written

DTYPES = ("<f4", "<f8", "<u2", "|u1", "<i8", "<f2", "|b1", "<c8", "<U3", "<M8[s]", ">f4", ">u2")
ENCODINGS = ("rgb8", "bgra8", "mono8", "16UC1", "32FC1", "mono16", "8UC3", "bayer")


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
        make_frame(
            rgb=given.pop("rgb", None), segmap=given.pop("segmap", None), **given, depth_scale=scale
        )
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
    digest = hashlib.sha256((PRIOR / FILE).read_bytes()).hexdigest().encode()
    line = data.replace(b"\n", b" ").replace(b"DIGEST", digest)
    (PRIOR / INDEX_FILE).write_bytes(
        hashlib.sha256(line).hexdigest().encode() + b"\n" + line + b"\n"
    )
    found = read_index(PRIOR)
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
