"""Every way in which a frame can be wrong, and the message it gets."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame, require_objects

K = np.array([[60.0, 0, 4], [0, 60.0, 3], [0, 0, 1]])
SHAPE = (6, 8)


def good(**changes):
    """Arguments of a good frame, with changes."""
    mask = np.zeros(SHAPE, int)
    mask[2:4, 2:4] = 7
    arguments = {
        "rgb": np.zeros((*SHAPE, 3), np.uint8),
        "segmap": mask,
        "depth": np.full(SHAPE, 0.8, np.float32),
        "K": K,
    }
    return {**arguments, **changes}


def matrix(**entries):
    """K with entries changed, such as a00=-1."""
    changed = K.copy()
    for name, value in entries.items():
        changed[int(name[1]), int(name[2])] = value
    return changed


ROWS, COLUMNS = np.mgrid[:6, :8]
POINTS = np.stack([(COLUMNS - 4) / 75, (ROWS - 3) / 75, np.full(SHAPE, 0.8)], axis=-1)
SHUFFLED = np.random.default_rng(0).permutation(POINTS.reshape(-1, 3)).reshape(6, 8, 3)
ONE_PIXEL = np.where((ROWS == 2)[..., None] & (COLUMNS == 2)[..., None], POINTS, np.nan)
SHEAR = np.diag([1.0, 2, 1, 1])

ZOO = {
    "depth all zero": ({"depth": np.zeros(SHAPE)}, "no valid pixel"),
    "depth all NaN": ({"depth": np.full(SHAPE, np.nan)}, "NaN or inf everywhere"),
    "depth all inf": ({"depth": np.full(SHAPE, np.inf)}, "NaN or inf everywhere"),
    "depth negative": ({"depth": np.full(SHAPE, -0.8)}, "negative depth"),
    "one negative": ({"depth": np.where(np.eye(6, 8), -1, 0.8)}, "negative depth"),
    "float millimetres": ({"depth": np.full(SHAPE, 800.0)}, r"depth_scale=0\.001"),
    "scale too large": ({"depth_scale": 100.0}, "in another unit"),
    "scale too small": ({"depth_scale": 1e-3}, "in another unit"),
    "scale negative": ({"depth_scale": -1.0}, "no positive number"),
    "TUM units as mm": ({"depth": np.full(SHAPE, 25_000, np.uint16)}, "in another unit"),
    "depth of one row": ({"depth": np.ones(8)}, "depth has the wrong shape"),
    "depth empty": ({"depth": np.ones((0, 8))}, "depth is empty"),
    "depth complex": ({"depth": np.ones(SHAPE, complex)}, "real numbers"),
    "depth strings": ({"depth": np.full(SHAPE, "far")}, "real numbers"),
    "K missing": ({"K": None}, "without intrinsics"),
    "K flat": ({"K": K.ravel()}, "K has the wrong shape"),
    "K transposed": ({"K": K.T}, "transposed"),
    "K singular": ({"K": matrix(a11=0)}, "not positive"),
    "K negative": ({"K": matrix(a00=-60)}, "not positive"),
    "K NaN": ({"K": matrix(a02=np.nan)}, "finite"),
    "K skewed": ({"K": matrix(a01=5)}, "without skew"),
    "K last row": ({"K": matrix(a22=2)}, "without skew"),
    "K normalised": ({"K": matrix(a00=0.2, a11=0.2, a02=0.5, a12=0.5)}, "not in pixels"),
    "no geometry": ({"depth": None}, "Neither depth nor points"),
    "xyz shape": ({"depth": None, "xyz": np.ones((48, 3))}, "xyz has the wrong shape"),
    "xyz millimetres": ({"depth": None, "K": None, "xyz": POINTS * 1000}, "depth_scale=0"),
    "xyz behind": ({"depth": None, "K": None, "xyz": -POINTS}, "negative depth"),
    "xyz y up": ({"depth": None, "K": None, "xyz": POINTS * [1, -1, 1]}, "no pinhole"),
    "xyz in world": ({"depth": None, "K": None, "xyz": POINTS[..., ::-1] + 1}, "no pinhole"),
    "xyz shuffled": ({"depth": None, "K": None, "xyz": SHUFFLED}, "no pinhole"),
    "xyz against K": (
        {"depth": None, "K": matrix(a00=90), "xyz": POINTS * [9, 1, 1]},
        "no pinhole",
    ),
    "xyz one pixel": ({"depth": None, "K": None, "xyz": ONE_PIXEL}, "no pinhole"),
    "mask size": ({"segmap": np.ones((6, 9), int)}, "wrong shape"),
    "mask colour": ({"segmap": np.ones((6, 8, 3), int)}, "no map of object ids"),
    "mask fractions": ({"segmap": np.full(SHAPE, 0.5)}, "no map of object ids"),
    "mask NaN": ({"segmap": np.full(SHAPE, np.nan)}, "no map of object ids"),
    "mask too big": ({"segmap": np.full(SHAPE, 2**63, np.uint64)}, "no map of object ids"),
    "masks apart": ({"segmap": np.ones((5, 6, 8), bool)}, r"\(5, 6, 8\)(.|\n)*join single masks"),
    "rgb float": ({"rgb": np.zeros((*SHAPE, 3))}, "rgb has the wrong type"),
    "rgb grey": ({"rgb": np.zeros(SHAPE, np.uint8)}, "rgb has the wrong shape"),
    "rgb size": ({"rgb": np.zeros((12, 16, 3), np.uint8)}, "rgb has the wrong shape"),
    "pose shape": ({"T_world_cam": np.eye(3)}, "no rigid transform"),
    "pose shear": ({"T_world_cam": SHEAR}, "no rigid transform"),
    "pose mirror": (
        {"T_world_cam": np.diag([1.0, 1, -1, 1])},
        "no rigid transform(.|\n)*left-handed(.|\n)*negate",
    ),
    "pose NaN": ({"T_world_cam": np.full((4, 4), np.nan)}, "no rigid transform"),
}


@pytest.mark.parametrize("name", ZOO)
def test_a_wrong_frame_gets_one_clear_message(name):
    changes, message = ZOO[name]
    with pytest.raises(FrameError, match=message):
        make_frame(**good(**changes))


COLOUR = np.zeros((*SHAPE, 3), np.uint8)
SWAPPED = {
    "colour as depth": ({"depth": COLOUR, "rgb": None}, "pass it as rgb"),
    "points as depth": ({"depth": POINTS}, "pass it as xyz"),
    "depth as points": ({"depth": None, "xyz": np.full(SHAPE, 0.8)}, "pass it as depth"),
    "depth as colour": ({"rgb": np.full(SHAPE, 0.8)}, "pass it as depth"),
    "points as colour": ({"rgb": POINTS}, "pass them as xyz"),
    "colour as masks": ({"segmap": COLOUR}, "pass it as rgb"),
    "depth as masks": ({"segmap": np.full(SHAPE, 0.85)}, "pass it as depth"),
    "masks as depth": (
        {"depth": good()["segmap"], "segmap": np.full(SHAPE, 0.85)},
        "depth and segmap seem to be swapped",
    ),
    "masks of one byte as depth": ({"depth": good()["segmap"].astype("u1")}, "pass them as segmap"),
    "pose as K": ({"K": np.eye(4)}, "pass it as T_world_cam"),
    "K as pose": ({"T_world_cam": K}, "pass it as K"),
    "depth as K": ({"K": np.full(SHAPE, 0.8), "depth": K}, "pass it as depth"),
    "flat K": ({"K": K.ravel()}, r"reshape it to \(3, 3\)"),
}


@pytest.mark.parametrize("name", SWAPPED)
def test_an_array_under_anothers_name_is_told(name):
    changes, message = SWAPPED[name]
    with pytest.raises(FrameError, match=message) as error:
        make_frame(**good(**changes))
    assert "--" not in str(error.value), "there are no options in Python"


def test_masks_and_integer_depth_that_are_swapped_are_told():
    z = (700 + np.arange(2000)).astype(np.uint16).reshape(40, 50)
    ids = np.zeros((40, 50), np.uint16)
    ids[5:9, 5:9] = 700
    camera = np.array([[60.0, 0, 25], [0, 60.0, 20], [0, 0, 1]])
    assert make_frame(depth=z, segmap=ids, K=camera).object_ids == [700]
    with pytest.raises(FrameError, match="seem to be swapped"):
        make_frame(depth=ids, segmap=z, K=camera)


def test_arguments_go_by_name_alone():
    with pytest.raises(TypeError):
        make_frame(good()["rgb"], good()["segmap"], depth=good()["depth"], K=K)


def test_a_mask_without_objects_is_told_how_to_be_mended():
    frame = make_frame(**good(segmap=np.zeros(SHAPE, int)))
    with pytest.raises(FrameError, match=r"no object in the mask(.|\n)*--segment"):
        require_objects(frame)


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.int64, np.float32])
def test_masks_of_any_dtype_keep_their_ids(dtype):
    mask = good()["segmap"].astype(dtype)
    mask[0, 0] = 250
    assert make_frame(**good(segmap=mask)).object_ids == [7, 250]


def test_negative_ids_are_objects():
    mask = np.where(good()["segmap"] == 7, -4, 0)
    assert make_frame(**good(segmap=mask)).object_ids == [-4]


@pytest.mark.parametrize(
    ("ids", "message"),
    [
        ({"object": 7, "rest": -1}, r"mark with -1 what is no object(.|\n)*-1 in 91\.7 % of the"),
        ({"object": 7, "rest": 0, "corner": -1}, r"mark with -1(.|\n)*segmap == -1\] = 0"),
        ({"object": 7, "rest": -2}, "mark with -2 what is no object"),
        ({"object": 7, "rest": 255}, r"no background(.|\n)*255 in 91\.7 %(.|\n)*set what is no"),
        ({"object": -4, "rest": 2}, "no background"),
    ],
)
def test_a_background_that_is_not_0_is_told(ids, message):
    mask = np.where(good()["segmap"] == 7, ids["object"], ids["rest"])
    mask[0, 0] = ids.get("corner", ids["rest"])
    with pytest.raises(FrameError, match=message):
        make_frame(**good(segmap=mask))


def test_an_object_that_looks_like_the_background_is_noted(caplog):
    near = np.full(SHAPE, 7)
    near[0, 0] = 0  # before a near camera an object fills the image
    for mask in (near, np.full(SHAPE, 7)):
        caplog.clear()
        assert make_frame(**good(segmap=mask)).object_ids == [7]
        assert "object 7 covers" in caplog.text and "set its pixels to 0" in caplog.text
    caplog.clear()
    near[:, 0] = 0
    make_frame(**good(segmap=near))
    make_frame(**good(segmap=None))
    assert not caplog.text, "it leaves one border free, and a frame without masks has no object"


@pytest.mark.parametrize("name", ["rgb", "segmap"])
@pytest.mark.parametrize("geometry", ["depth", "xyz"])
def test_another_size_than_depths_is_told_before_the_intrinsics_are_judged(name, geometry):
    half = {"depth": np.full((3, 4), 0.8)} if geometry == "depth" else {"xyz": POINTS[:3, :4]}
    given = good(**{"depth": None, **half})
    given["segmap" if name == "rgb" else "rgb"] = None
    with pytest.raises(FrameError, match=f"{name} has the wrong shape") as error:
        make_frame(**given)
    assert "8 x 6" in error.value.found and "4 x 3" in error.value.expected
    assert "one resolution" in error.value.fix


def test_errors_of_intrinsics_and_units_say_what_to_do():
    for changes in (
        {"K": None},
        {"K": matrix(a00=-60)},
        {"K": matrix(a02=np.nan)},
        {"K": matrix(a01=5)},
        {"K": np.eye(2)},
        {"depth_scale": -1.0},
    ):
        with pytest.raises(FrameError) as error:
            make_frame(**good(**changes))
        assert error.value.fix, changes


@pytest.mark.parametrize("dtype", [np.int32, np.int64, np.uint32])
def test_the_largest_number_of_16_bits_is_no_return_in_a_wider_type(dtype, caplog):
    depth = np.full(SHAPE, 900, dtype)
    depth[:2, :2] = 65535
    with caplog.at_level("INFO"):
        frame = make_frame(**good(depth=depth))
    assert not frame.valid[:2, :2].any() and frame.valid[2:].all()
    assert "4 pixels with 65535, the largest number of uint16: no return" in caplog.text
    # Among larger numbers it is one as any other.
    depth = depth * dtype(10)
    depth[0, 0], depth[0, 1] = 65535, 70000
    frame = make_frame(**good(depth=depth), depth_scale=0.0001)
    assert frame.points[0, 0, 2] == pytest.approx(6.5535)


@pytest.mark.parametrize("dtype", [np.uint16, np.uint32])
def test_the_largest_number_of_an_unsigned_type_is_no_return(dtype, caplog):
    caplog.set_level(logging.INFO)
    depth = np.full(SHAPE, 800, dtype)
    make_frame(**good(depth=depth))
    assert "no return" not in caplog.text
    depth[:2, :2] = np.iinfo(dtype).max
    frame = make_frame(**good(depth=depth))
    assert not frame.valid[:2, :2].any() and frame.valid.sum() == 44
    assert f"4 pixels with {np.iinfo(dtype).max}" in caplog.text and "no return" in caplog.text
    assert depth[0, 0] == np.iinfo(dtype).max, "the caller's array stays"
    with pytest.raises(FrameError, match="no valid pixel"):
        make_frame(**good(depth=np.full(SHAPE, np.iinfo(dtype).max, dtype)))


@pytest.mark.parametrize(
    ("raw", "scale", "metres"),
    [
        (np.uint16(800), None, 0.8),
        (np.int32(1500), None, 1.5),
        (np.float64(0.8), None, 0.8),
        (np.uint16(5000), 0.0002, 1.0),
        (np.float32(800), 0.001, 0.8),
    ],
)
def test_depth_becomes_metres(raw, scale, metres):
    frame = make_frame(**good(depth=np.full(SHAPE, raw), depth_scale=scale))
    assert frame.points[..., 2] == pytest.approx(metres, rel=1e-6)


def test_pixels_without_return_are_not_valid():
    depth = good()["depth"].copy()
    depth[0, 0], depth[0, 1], depth[0, 2] = 0, np.nan, np.inf
    valid = make_frame(**good(depth=depth)).valid
    assert not valid[0, :3].any()
    assert valid.sum() == 45


def test_an_object_on_invalid_depth_alone_is_kept_without_points():
    depth = np.where(good()["segmap"] == 7, np.nan, 0.8)
    frame = make_frame(**good(depth=depth))
    assert frame.object_ids == [7]
    assert frame.object_points(7).shape == (0, 3)


def test_points_follow_the_pinhole_camera():
    frame = make_frame(**good())
    assert frame.points == pytest.approx(POINTS.astype(np.float32), abs=1e-6)


def test_intrinsics_are_recovered_from_points():
    points = POINTS.copy()
    points[1, 1] = np.nan
    points[2, 2] = 0
    frame = make_frame(**good(depth=None, K=None, xyz=points))
    assert pytest.approx(K, abs=1e-4) == frame.K
    assert not frame.valid[1, 1]
    assert not frame.valid[2, 2]


def test_a_principal_point_outside_the_image_is_noted(caplog):
    caplog.set_level(logging.INFO)
    make_frame(**good(K=matrix(a02=20)))
    assert "outside the 8 x 6 image" in caplog.text


def test_intrinsics_of_a_smaller_image_are_noted(caplog):
    depth = np.ones((120, 160))
    half = [[75, 0, 40], [0, 75, 30], [0, 0, 1]]
    make_frame(depth=depth, K=half)
    assert "middle of about 80 x 60 pixels, not of 160 x 120" in caplog.text
    caplog.clear()
    make_frame(depth=depth, K=[[150, 0, 80], [0, 150, 60], [0, 0, 1]])
    make_frame(depth=depth, K=[[150, 0, 40], [0, 150, 60], [0, 0, 1]])
    assert "middle of about" not in caplog.text


def test_a_camera_far_from_the_worlds_origin_is_noted(caplog):
    K, pose = [[150, 0, 80], [0, 150, 60], [0, 0, 1]], np.eye(4)
    pose[:3, 3] = 0.3, -0.2, 0.9
    make_frame(depth=np.ones((120, 160)), K=K, T_world_cam=pose)
    assert "origin" not in caplog.text
    pose[:3, 3] *= 1000
    make_frame(depth=np.ones((120, 160)), K=K, T_world_cam=pose)
    assert "969.5 m from the world's origin" in caplog.text and "metres" in caplog.text


def test_missing_colour_becomes_grey():
    assert (make_frame(**good(rgb=None)).rgb == 128).all()


def test_the_callers_arrays_stay_as_they_were():
    arguments = good(T_world_cam=np.eye(4))
    before = {name: value.copy() for name, value in arguments.items()}
    frame = make_frame(**arguments)
    for name, value in before.items():
        assert np.array_equal(arguments[name], value), name
        assert arguments[name].flags.writeable, name
    arguments["segmap"][:] = 9
    assert frame.object_ids == [7]
    with pytest.raises(ValueError, match="read-only"):
        frame.points[0, 0] = 0


def test_other_masks_leave_the_image_as_it_is():
    depth = np.full((3, 4), 0.5, np.float32)
    frame = make_frame(segmap=np.ones((3, 4), np.int64), depth=depth, K=np.eye(3))
    assert frame.valid.all() and frame.object_ids == [1]
    masks = np.zeros(frame.shape, np.uint8)
    masks[0, 1] = 7
    other = frame.with_masks(masks)
    assert other.object_ids == [7] and frame.object_ids == [1]
    assert other.points is frame.points and other.valid is frame.valid
    masks[0, 1] = 0
    assert other.segmap[0, 1] == 7 and not other.segmap.flags.writeable
    with pytest.raises(FrameError, match="another size"):
        frame.with_masks(masks[:, 1:])
