"""What the network that parts objects looks at."""

import numpy as np
import pytest

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.build import make_frame
from brrp_cli.segmentation.image_channels import (
    CHANNELS,
    SIDEWAYS,
    image_channels,
    resized,
    size_of,
)
from brrp_cli.segmentation.seen_surfaces import see_surfaces


@pytest.fixture(scope="module")
def frame(scene):
    return make_frame(rgb=scene.rgb, depth=scene.depth, K=scene.K)


def channels_of(frame):
    """What is seen, and channels, of a small frame: at twice its size."""
    seen = see_surfaces(frame, 0, SegmentConfig())
    channels = image_channels(frame.rgb, seen)
    assert channels.shape == (CHANNELS, *(2 * side for side in frame.shape))
    assert channels.dtype == np.int8
    return seen, channels


def at_its_size(channels, frame):
    """The channels at the frame's own size."""
    return np.moveaxis(resized(np.moveaxis(channels, 0, -1), frame.shape), -1, 0)


def test_images_become_about_as_large_and_tiny_ones_are_no_more_than_doubled():
    sizes = {(480, 640): (480, 640), (720, 1280): (480, 853), (1536, 2048): (480, 640)}
    sizes |= {(1000, 500): (960, 480), (240, 320): (480, 640), (360, 640): (480, 853)}
    for shape, size in {**sizes, (120, 160): (240, 320)}.items():
        assert size_of(shape) == size


def test_what_becomes_smaller_is_the_nearest_and_comes_back_in_its_place():
    rows, columns = np.indices((9, 15))
    assert resized(rows, (3, 5))[:, 0].tolist() == [1, 4, 7]
    assert resized(columns, (3, 5))[0].tolist() == [1, 4, 7, 10, 13]
    few = np.arange(15).reshape(3, 5)
    assert np.array_equal(resized(few, (9, 15)), few.repeat(3, axis=0).repeat(3, axis=1))
    # By what is no whole number, too: a straight edge stays within a pixel of itself.
    edge = np.indices((720, 1280))[1] < 500
    back = resized(resized(edge, size_of(edge.shape)), edge.shape)
    assert (back[:, :499]).all() and not back[:, 501:].any()
    flat = np.zeros((9, 15, 2))
    assert resized(flat, (9, 15)) is flat and resized(flat, (3, 5)).shape == (3, 5, 2)


def test_the_table_is_flat_and_objects_rise(frame, scene):
    seen, channels = channels_of(frame)
    channels = at_its_size(channels, frame)
    height, up = channels[3], channels[7]
    can = scene.segmap == 7
    table = (scene.segmap == 0) & (scene.depth < 1.1) & seen.valid
    assert np.abs(np.median(height[table])) <= 1
    assert np.median(height[can & seen.valid]) > 5
    assert np.median(up[table]) > 60  # 63 is upright


def test_stripes_as_fine_as_pixels_become_grey_in_a_large_image(scene):
    def large(values):
        return np.asarray(values).repeat(8, axis=0).repeat(8, axis=1)

    K = scene.K.copy()
    K[:2] *= 8
    rgb = large(np.zeros_like(scene.rgb))
    rgb[:, ::2] = 255
    frame = make_frame(rgb=rgb, depth=large(scene.depth), K=K)
    assert frame.shape == (960, 1280) and size_of(frame.shape) == (480, 640)
    colour = image_channels(rgb, see_surfaces(frame, 0, SegmentConfig()))[:3, :, 1:-1]
    assert np.abs(colour).max() <= 1


def test_a_mirrored_image_has_mirrored_channels(frame):
    K = frame.K.copy()
    K[0, 2] = frame.shape[1] - 1 - K[0, 2]
    turned = make_frame(rgb=frame.rgb[:, ::-1], depth=frame.points[:, ::-1, 2], K=K)
    mirrored = channels_of(turned)[1][..., ::-1].copy()
    mirrored[SIDEWAYS] *= -1
    same = np.abs(mirrored.astype(int) - channels_of(frame)[1]) <= 3
    assert same.mean() > 0.97


def test_missing_depth_is_zero(scene):
    depth = scene.depth.copy()
    depth[40:60, 30:70] = np.nan
    frame = make_frame(rgb=scene.rgb, depth=depth, K=scene.K)
    channels = at_its_size(channels_of(frame)[1], frame)
    hole = np.s_[:, 42:58, 32:68]
    assert not channels[3:8][hole].any() and not channels[10][hole[1:]].any()
    assert channels[:3][hole].any()
