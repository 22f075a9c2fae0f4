"""Frame files: round trips, and files that lie."""

from __future__ import annotations

import io
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from brrp_cli.errors import FrameError, OutputError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.npz import load_frame, save_frame

K = np.array([[60.0, 0, 4], [0, 60.0, 3], [0, 0, 1]])
DEPTH = np.full((6, 8), 0.8, np.float32)
MASK = np.zeros((6, 8), np.int32)
MASK[2:4, 2:4] = 7
RGB = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)


def same(first, second):
    """Whether two frames hold the same bytes."""
    return all(
        np.array_equal(getattr(first, name), getattr(second, name), equal_nan=name == "points")
        for name in ("rgb", "points", "segmap", "K")
    ) and (
        first.T_world_cam is second.T_world_cam is None
        or np.array_equal(first.T_world_cam, second.T_world_cam)
    )


@settings(deadline=None, max_examples=30)
@given(
    depth=hnp.arrays(np.float32, (6, 8), elements=st.floats(0.25, 4, width=32)),
    holes=hnp.arrays(bool, (6, 8)),
    mask=hnp.arrays(
        np.int64, (6, 8), elements=st.integers(-(2**40), 2**40).filter(lambda i: i != -1)
    ),
    posed=st.booleans(),
    as_points=st.booleans(),
)
def test_a_frame_comes_back_as_it_was(tmp_path_factory, depth, holes, mask, posed, as_points):
    holes[0, :2], holes[5, 7] = False, False
    mask[0], mask[3, 3] = 0, 5  # masks have a background, which is 0 and never -1
    depth = np.where(holes, np.nan, depth)
    frame = make_frame(
        rgb=RGB, segmap=mask, depth=depth, K=K, T_world_cam=np.eye(4) if posed else None
    )
    if as_points:
        bent = frame.points + np.float32(1e-4)
        frame = make_frame(rgb=RGB, segmap=mask, xyz=bent, T_world_cam=frame.T_world_cam)
    path = tmp_path_factory.mktemp("frames") / "frame.npz"
    save_frame(frame, path)
    assert same(load_frame(path), frame)


def test_the_same_frame_is_the_same_bytes(tmp_path):
    frame = make_frame(rgb=RGB, segmap=MASK, depth=DEPTH, K=K)
    save_frame(frame, tmp_path / "a.npz")
    save_frame(frame, tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_masks_that_were_left_out_come_back_until_other_masks_are_given(tmp_path):
    aside = np.zeros_like(MASK)
    aside[5, :3] = 2
    frame = make_frame(rgb=RGB, segmap=MASK, depth=DEPTH, K=K).with_masks(MASK, aside)
    save_frame(frame, tmp_path / "a.npz")
    found = load_frame(tmp_path / "a.npz")
    assert same(found, frame) and np.array_equal(found.aside, aside)
    assert not found.aside.flags.writeable
    given = found.with_masks(found.segmap)
    save_frame(given, tmp_path / "b.npz")
    assert given.aside is None and load_frame(tmp_path / "b.npz").aside is None


def test_which_masks_were_corrected_comes_back(tmp_path):
    known = frozenset(make_frame(rgb=RGB, segmap=MASK, depth=DEPTH, K=K).object_ids[:1])
    frame = make_frame(rgb=RGB, segmap=MASK, depth=DEPTH, K=K).with_masks(MASK, MASK * 0, known)
    save_frame(frame, tmp_path / "a.npz")
    assert known and load_frame(tmp_path / "a.npz").corrected == known
    assert frame.with_masks(MASK).corrected == frozenset()
    # An id that no mask has is none.
    np.savez(tmp_path / "b.npz", depth=DEPTH, K=K, segmap=MASK, left_out=MASK * 0, corrected=[777])
    assert load_frame(tmp_path / "b.npz").corrected == frozenset()


@pytest.mark.parametrize("wrong", [np.zeros((1, 1), int), np.array([1.0])])
def test_ids_of_corrected_masks_are_checked(tmp_path, wrong):
    np.savez(tmp_path / "f.npz", depth=DEPTH, K=K, segmap=MASK, left_out=MASK * 0, corrected=wrong)
    with pytest.raises(FrameError, match="corrected"):
        load_frame(tmp_path / "f.npz")


@pytest.mark.parametrize("wrong", [MASK[1:], MASK + 0.5, np.zeros((6, 8, 2), int)])
def test_masks_that_were_left_out_are_checked(tmp_path, wrong):
    np.savez(tmp_path / "f.npz", depth=DEPTH, K=K, segmap=MASK, left_out=wrong)
    with pytest.raises(FrameError, match="left_out"):
        load_frame(tmp_path / "f.npz")


def test_contact_graspnets_other_names_are_read(tmp_path):
    path = tmp_path / "frame.npz"
    np.savez(path, depth=(DEPTH * 1000).astype(np.uint16), K=K, seg=MASK)
    frame = load_frame(path)
    assert frame.object_ids == [7]
    assert frame.points[..., 2] == pytest.approx(0.8)


def test_keys_that_nobody_asked_for_are_not_loaded(tmp_path):
    path = tmp_path / "frame.npz"
    np.savez(path, depth=DEPTH, K=K, segmap=MASK, notes=np.array([{"a": 1}], dtype=object))
    assert load_frame(path).object_ids == [7]


@pytest.mark.parametrize("missing", ["depth", "K", "segmap"])
def test_a_missing_key_lists_those_found_and_those_accepted(tmp_path, missing):
    arrays = {"depth": DEPTH, "K": K, "segmap": MASK, "rgb": RGB}
    del arrays[missing]
    path = tmp_path / "frame.npz"
    np.savez(path, **arrays)
    with pytest.raises(FrameError) as caught:
        load_frame(path)
    assert caught.value.found == ", ".join(sorted(arrays))
    assert "depth and K, or xyz; segmap or seg" in str(caught.value)
    assert missing in caught.value.what


def test_a_misnamed_key_is_shown(tmp_path):
    path = tmp_path / "frame.npz"
    np.savez(path, Depth=DEPTH, K=K, segmap=MASK)
    with pytest.raises(FrameError, match=r"found:\s+Depth, K, segmap"):
        load_frame(path)


def test_masks_may_be_absent_when_asked(tmp_path):
    path = tmp_path / "frame.npz"
    np.savez(path, depth=DEPTH, K=K)
    assert load_frame(path, masks=False).object_ids == []


def test_an_empty_mask_is_refused(tmp_path):
    path = tmp_path / "frame.npz"
    np.savez(path, depth=DEPTH, K=K, segmap=MASK * 0)
    with pytest.raises(FrameError, match="no object in the mask"):
        load_frame(path)


def test_pickles_are_refused_by_the_name_of_the_key(tmp_path):
    path = tmp_path / "frame.npz"
    np.savez(path, depth=np.array([{"depth": 1}], dtype=object), K=K, segmap=MASK)
    with pytest.raises(FrameError, match=r"pickle(.|\n)*frame\.npz: depth"):
        load_frame(path)


def header(shape: tuple[int, ...], descr: str = "<f4") -> bytes:
    """The header of an .npy file that declares `shape`."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        stream, {"descr": descr, "fortran_order": False, "shape": shape}
    )
    return stream.getvalue()


@pytest.mark.parametrize(
    ("depth", "message"),
    [
        pytest.param(header((10**6, 10**6)), "too large", id="declares 10^12"),
        pytest.param(header((8000, 8000)) + bytes(256_000_000), "too large", id="zeros of 256 MB"),
        pytest.param(header((6, 8)) + bytes(20), "cannot be read", id="data cut"),
        pytest.param(header((-6, 8)), "cannot be read|shape", id="negative shape"),
        pytest.param(b"\x93NUMPY\x01\x00\xff\xff{'descr'", "cannot be read", id="header cut"),
        pytest.param(b"\x93NUMPY\x09\x00" + bytes(64), "cannot be read", id="unknown version"),
        pytest.param(b"junk", "cannot be read", id="junk"),
        pytest.param(b"", "cannot be read", id="empty"),
    ],
)
def test_hostile_members_are_refused_without_being_unpacked(tmp_path, depth, message):
    path = tmp_path / "frame.npz"
    np.savez(path, K=K, segmap=MASK)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        archive.writestr("depth.npy", depth)
    assert path.stat().st_size < 300_000
    del depth
    tracemalloc.start()
    with pytest.raises(FrameError, match=message):
        load_frame(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5_000_000


def test_compressions_that_python_cannot_bound_are_refused(tmp_path):
    path = tmp_path / "frame.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("depth.npy", header((6, 8)) + DEPTH.tobytes())
    with pytest.raises(FrameError, match="cannot be read"):
        load_frame(path)


def test_damaged_files_are_refused_at_every_length(tmp_path):
    whole = tmp_path / "whole.npz"
    np.savez_compressed(whole, depth=DEPTH, K=K, segmap=MASK)
    data = whole.read_bytes()
    path = tmp_path / "cut.npz"
    for length in range(0, len(data), 37):
        path.write_bytes(data[:length])
        with pytest.raises(FrameError):
            load_frame(path)


def test_flipped_bits_never_change_a_frame_in_silence(tmp_path):
    whole = tmp_path / "whole.npz"
    np.savez_compressed(whole, depth=DEPTH, K=K, segmap=MASK, rgb=RGB)
    truth, data = load_frame(whole), bytearray(whole.read_bytes())
    path = tmp_path / "flipped.npz"
    for position in np.random.default_rng(1).integers(0, 8 * len(data), 300):
        flipped = bytearray(data)
        flipped[position // 8] ^= 1 << (position % 8)
        path.write_bytes(flipped)
        try:
            frame = load_frame(path)
        except FrameError:
            continue
        assert np.array_equal(frame.points, truth.points, equal_nan=True)
        assert np.array_equal(frame.segmap, truth.segmap)


def test_flipped_bits_of_a_long_members_header_are_told_or_do_not_matter(tmp_path):
    """In a member so long that its header is read before its checksum. NumPy takes a header that it
    cannot evaluate for one of Python 2, and fails on it with errors of its own."""
    path = tmp_path / "f.npz"
    mask, depth = np.tile(MASK, (5, 5)), np.tile(DEPTH, (5, 5))
    np.savez(path, segmap=mask, depth=depth, K=K)
    right = load_frame(path)
    data = path.read_bytes()
    start = data.index(b"\x93NUMPY")
    for bit in range(8 * start, 8 * data.index(mask.tobytes()), 3):
        path.write_bytes(flipped(data, bit))
        try:
            assert same(load_frame(path), right)
        except FrameError as error:
            assert str(path) in str(error.where)


def flipped(data, bit):
    """The same bytes but for one bit."""
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << (bit % 8)
    return bytes(changed)


@pytest.mark.parametrize(
    "data",
    [b"", b"not a zip", struct.pack("<I", 0x06054B50) + bytes(40)],
    ids=["0", "text", "eocd"],
)
def test_what_is_no_npz_is_refused(tmp_path, data):
    path = tmp_path / "frame.npz"
    path.write_bytes(data)
    with pytest.raises(FrameError):
        load_frame(path)


def test_a_bare_npy_a_folder_and_nothing_are_refused(tmp_path):
    np.save(tmp_path / "depth.npy", DEPTH)
    for path in (tmp_path / "depth.npy", tmp_path, tmp_path / "none.npz"):
        with pytest.raises(FrameError, match=str(path)):
            load_frame(path)


def test_an_unwritable_place_is_told(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError):
        save_frame(
            make_frame(rgb=RGB, segmap=MASK, depth=DEPTH, K=K), tmp_path / "file" / "frame.npz"
        )
