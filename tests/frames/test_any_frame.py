"""Whatever is handed in: a frame that keeps its promises, or one of the project's own errors."""

from __future__ import annotations

import io
import json
import logging
import resource
import signal
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from file_faults import in_a_process
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from brrp_cli.config import ObservationConfig
from brrp_cli.errors import BrrpError, FrameError, PriorError, RetrievalError, SceneError
from brrp_cli.evaluation.rows import METRICS, RowLog, table, variant_columns
from brrp_cli.evaluation.variants import Variant
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.intrinsics import read_intrinsics
from brrp_cli.frames.npz import load_frame
from brrp_cli.ground_truth.truth import read_objects
from brrp_cli.observation.ray_samples import observe
from brrp_cli.prior.build.descriptions import read_descriptions
from brrp_cli.prior.manifest import parse_manifest
from brrp_cli.retrieval.table import TableRetriever

CASES = settings(
    deadline=None,
    max_examples=150,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
K = np.array([[60.0, 0, 4], [0, 60.0, 3], [0, 0, 1]])
SIZE = (6, 8)

# Numbers that people's arrays hold, the harmful ones among them.
numbers = st.sampled_from(
    [
        0.0,
        -0.0,
        0.5,
        0.8,
        1.0,
        2.0,
        60.0,
        -1.0,
        1e-30,
        1e30,
        3e38,
        800.0,
        99.0,
        101.0,
        np.nan,
        np.inf,
    ]
) | st.floats(width=32)
dtypes = st.sampled_from(
    ["f4", "f8", "f2", "u1", "u2", "i4", "i8", "b1", ">f4", "c8", "U2", "M8[s]"]
)
shapes = st.sampled_from([SIZE, (*SIZE, 3), (*SIZE, 1), (3, 3), (4, 4), (9,), (), (0, 8), (8, 6)])


@st.composite
def arrays(draw: st.DrawFn, shape: tuple[int, ...], kind: str = "f4") -> np.ndarray:
    """Mostly of the right shape and type."""
    if draw(st.integers(0, 9)) == 0:
        shape = draw(shapes)
    kind = draw(dtypes) if draw(st.integers(0, 5)) == 0 else kind
    if kind == "U2":
        return np.full(shape, "a")
    if kind == "M8[s]":
        return np.zeros(shape, "M8[s]")
    plain = draw(hnp.arrays(np.float64, shape, elements=numbers, fill=st.sampled_from([0.8, 1.0])))
    with np.errstate(all="ignore"):
        return plain.astype(kind)


def keeps_its_promises(frame) -> None:
    assert np.isfinite(frame.points[frame.valid]).all()
    assert (frame.points[frame.valid][:, 2] > 0).all()
    assert np.isfinite(frame.K).all() and frame.rgb.dtype == np.uint8
    assert frame.rgb.shape[:2] == frame.segmap.shape == frame.points.shape[:2]
    few = ObservationConfig(min_points=4, below_draws=200)
    scene = observe(frame, few, 0)
    assert {*scene.objects, *scene.too_few} == set(frame.object_ids)
    for seen in scene.objects.values():
        assert np.isfinite(seen.samples).all() and np.isfinite(seen.center).all()
        assert len(seen.samples) == len(seen.labels)


@CASES
@given(data=st.data())
def test_any_arrays_become_a_frame_or_a_frame_error(data: st.DataObject) -> None:
    some = {
        "segmap": arrays(SIZE, "i4"),
        "rgb": arrays((*SIZE, 3), "u1"),
        "T_world_cam": arrays((4, 4)),
        "depth_scale": st.sampled_from([0.001, 1.0, 0.0, -1.0, np.nan, 1e300]),
    }
    given_ = {key: data.draw(how) for key, how in some.items() if data.draw(st.booleans())}
    if data.draw(st.booleans()):
        given_["depth"] = data.draw(arrays(SIZE))
        given_["K"] = data.draw(st.just(K) | arrays((3, 3)))
    else:
        given_["xyz"] = data.draw(arrays((*SIZE, 3)))
    with np.errstate(all="ignore"):
        try:
            frame = make_frame(
                rgb=given_.pop("rgb", None), segmap=given_.pop("segmap", None), **given_
            )
        except FrameError as error:
            assert len(str(error)) < 5_000
        else:
            keeps_its_promises(frame)


@CASES
@given(
    depth=hnp.arrays(np.float32, SIZE, elements=numbers, fill=st.just(np.float32(0.8))),
    mask=hnp.arrays(np.int16, SIZE, elements=st.sampled_from([0, 0, 7, 250, -3])),
)
def test_good_types_with_any_numbers_become_a_frame_or_a_frame_error(depth, mask) -> None:
    with np.errstate(all="ignore"):
        try:
            keeps_its_promises(make_frame(segmap=mask, depth=depth, K=K))
        except FrameError:
            return


KEYS = """fx fy cx cy K width height depth_scale id mesh_path position orientation scale 0 cup
kind schema parameters objects shards failed appearance name sha256 bytes file record"""


def texts() -> st.SearchStrategy[bytes]:
    leaves = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
    keys = st.sampled_from(KEYS.split())
    tree = st.recursive(
        leaves, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=6)
    )
    return (
        st.binary(max_size=60)
        | tree.map(lambda value: json.dumps(value).encode())
        | st.integers(1, 200_000).map(lambda n: b"[" * n)
        | st.integers(19, 5000).map(lambda n: b'{"fx": 1' + b"0" * n + b"}")
    )


@CASES
@given(data=texts(), suffix=st.sampled_from([".json", ".csv", ".toml"]))
def test_any_table_is_read_or_refused(tmp_path: Path, data: bytes, suffix: str) -> None:
    path = tmp_path / f"table{suffix}"
    path.write_bytes(data)
    for read, error in (
        (lambda: read_intrinsics(path), FrameError),
        (lambda: read_objects(path), SceneError),
        (lambda: read_descriptions(path), PriorError),
        (lambda: TableRetriever(path, ["cup"]), RetrievalError),
        (lambda: parse_manifest(data, path), PriorError),
    ):
        try:
            read()
        except error:
            continue


GOOD_MANIFEST = {
    "kind": "brrp-prior",
    "schema": 2,
    "parameters": {"seed": 0},
    "objects": [
        {
            "name": "cup",
            "description": "a cup",
            "source": "cup.obj",
            "input_sha256": "aa",
            "shard": "shards/shard-0123456789abcdef.h5",
            "record": {"made_with": {"numpy": "2"}},
        }
    ],
    "shards": [{"file": "shards/shard-0123456789abcdef.h5", "sha256": 64 * "a", "bytes": 5}],
    "failed": [{"name": "x", "source": "x.obj", "reason": "open"}],
    "appearance": {"file": "appearance-0123456789abcdef.npy", "sha256": 64 * "b", "bytes": 5},
}


def places(value, path=()):
    """The path of every value in a table."""
    yield path
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from places(inner, (*path, key))


@CASES
@given(data=st.data())
def test_a_manifest_with_any_value_in_any_place_is_whole_or_refused(data: st.DataObject) -> None:
    table_ = json.loads(json.dumps(GOOD_MANIFEST))
    place = data.draw(st.sampled_from([p for p in places(GOOD_MANIFEST) if p]))
    inner = table_
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = data.draw(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
        | st.lists(st.integers(), max_size=2) | st.dictionaries(st.text(max_size=2), st.integers())
    )  # fmt: skip
    try:
        found = parse_manifest(json.dumps(table_).encode(), Path("manifest.json"))
    except PriorError:
        return
    # What is taken can be written, and is read back as it was.
    assert parse_manifest(found.as_bytes(), Path("manifest.json")) == found
    assert found.objects == sorted(found.objects, key=lambda entry: entry.name)


@CASES
@given(
    values=st.lists(
        st.dictionaries(
            st.sampled_from([*METRICS[:6], "message", "best"]),
            st.none() | st.floats() | st.text(max_size=20),
        ),
        max_size=4,
    ),
    cut=st.integers(0, 400),
)
def test_rows_survive_any_cut_and_any_text(tmp_path: Path, values, cut: int) -> None:
    variant = variant_columns(Variant("vprism"))
    rows = [
        {"scene": "a", "object_id": i, "objects_in_view": len(values), **variant, **value}
        for i, value in enumerate(values)
    ]
    log = RowLog(tmp_path / "rows.jsonl")
    log.path.unlink(missing_ok=True)
    log.append(rows)
    assert [row["object_id"] for row in log.read()] == [row["object_id"] for row in rows]
    table(log.read())
    data = log.path.read_bytes()
    log.path.write_bytes(data[: len(data) - cut] if cut else data)
    whole = log.path.read_bytes().count(b"\n")
    assert len(log.read()) == whole
    # One that is added after a torn line stands by itself.
    log.append([{"scene": "b", "object_id": 1, "objects_in_view": 1, **variant}])
    assert [row["scene"] for row in log.read()] == ["a"] * whole + ["b"]


def npz(**members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return stream.getvalue()


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def header(shape: tuple[int, ...]) -> bytes:
    stream = io.BytesIO()
    told = {"descr": "<f4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, told)
    return stream.getvalue()


HOSTILE = {
    "a pickle": lambda: npz(depth=npy(np.array([{"a": 1}], dtype=object)), K=npy(K)),
    "a bomb of 256 MB": lambda: npz(depth=header((8000, 8000)) + bytes(256_000_000), K=npy(K)),
    "10^12 elements": lambda: npz(depth=header((10**6, 10**6)), K=npy(K)),
    "many axes": lambda: npz(depth=header((1,) * 40), K=npy(K)),
    "a long header": lambda: npz(depth=b"\x93NUMPY\x02\x00" + b"\xff\xff\xff\x7f" + b" " * 10**6),
    "junk": lambda: np.random.default_rng(0).bytes(200_000),
    "a huge K": lambda: npz(depth=npy(np.ones(SIZE, "f4")), K=npy(np.zeros((2000, 2000)))),
    "an id for each pixel": lambda: npz(
        depth=npy(np.ones((400, 400), "f4")),
        K=npy(np.diag([400.0, 400, 1])),
        segmap=npy(np.arange(160_000).reshape(400, 400)),
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_frames_are_answered_within_a_second_and_200_mb(tmp_path: Path, name: str) -> None:
    path = tmp_path / "frame.npz"
    path.write_bytes(HOSTILE[name]())

    def work() -> None:
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + 200 * 2**20, resource.RLIM_INFINITY))
        signal.alarm(60)
        start = time.process_time()
        with pytest.raises(FrameError):
            load_frame(path)
        assert time.process_time() - start < 1

    assert in_a_process(work) == 0


# Pillow tells of every tag that a flipped bit harms; what it makes of it is what is tested.
@pytest.mark.filterwarnings("ignore::UserWarning:PIL.TiffImagePlugin")
@pytest.mark.parametrize("suffix", ["png", "jpg", "tiff"])
def test_images_with_flipped_bits_are_read_or_refused(tmp_path: Path, suffix: str) -> None:
    from PIL import Image

    from brrp_cli.frames.pixels import read_colour, read_depth, read_masks

    rng = np.random.default_rng(0)
    path = tmp_path / f"image.{suffix}"
    Image.fromarray(rng.integers(0, 255, (20, 30, 3), dtype=np.uint8)).save(path)
    whole = path.read_bytes()
    for bit in rng.integers(8 * min(len(whole), 400), size=150):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << (bit % 8)
        path.write_bytes(data)
        for read in (read_colour, read_depth, read_masks):
            try:
                read(path)
            except BrrpError:
                continue


# What the fuzzer found, kept: (reader, input, what is told).
def test_an_integer_of_400_digits_is_no_intrinsic(tmp_path: Path) -> None:
    path = tmp_path / "k.json"
    path.write_text('{"fx": 1' + 400 * "0" + ', "fy": 50, "cx": 3, "cy": 3}')
    with pytest.raises(FrameError, match="401 digits"):
        read_intrinsics(path)


def test_points_of_which_none_is_whole_are_refused() -> None:
    xyz = np.full((*SIZE, 3), 0.8)
    xyz[..., 0] = np.nan
    with pytest.raises(FrameError, match="no valid pixel"):
        make_frame(xyz=xyz)


def test_depth_beyond_a_hundred_metres_is_no_return_and_is_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    depth = np.full(SIZE, 0.8)
    depth[0, :3] = [101.0, 1e30, 3e38]
    frame = make_frame(depth=depth, K=K)
    assert not frame.valid[0, :3].any() and frame.valid.sum() == 45
    assert "3 pixels lie beyond 100 m" in caplog.text
