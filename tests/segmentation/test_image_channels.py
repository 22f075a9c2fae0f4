"""What the network that parts objects looks at."""

import numpy as np
import pytest

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.build import make_frame
from brrp_cli.segmentation.image_channels import CHANNELS, SIDEWAYS, image_channels, step_of
from brrp_cli.segmentation.seen_surfaces import see_surfaces


@pytest.fixture(scope="module")
def frame(scene):
    return make_frame(rgb=scene.rgb, depth=scene.depth, K=scene.K)


def test_images_of_any_size_are_about_as_small():
    assert [step_of(shape) for shape in [(120, 160), (480, 640), (720, 1280), (1536, 2048)]] == [
        1,
        2,
        3,
        6,
    ]


def test_the_table_is_flat_and_objects_rise(frame, scene):
    seen = see_surfaces(frame, 0, SegmentConfig())
    channels = image_channels(frame.rgb, seen)
    assert channels.shape == (CHANNELS, *frame.shape) and channels.dtype == np.int8
    height, up = channels[3], channels[7]
    can = scene.segmap == 7
    table = (scene.segmap == 0) & (scene.depth < 1.1) & seen.valid
    assert np.abs(np.median(height[table])) <= 1
    assert np.median(height[can & seen.valid]) > 5
    assert np.median(up[table]) > 60  # 63 is upright


def test_colour_is_the_mean_of_the_pixels_that_become_one(frame):
    seen = see_surfaces(frame, 0, SegmentConfig())
    colour = image_channels(frame.rgb, seen)[:3] / 63
    wanted = frame.rgb.transpose(2, 0, 1) / 127.5 - 1
    assert np.abs(colour - wanted).max() < 0.01


def test_a_mirrored_image_has_mirrored_channels(frame):
    seen = see_surfaces(frame, 0, SegmentConfig())
    K = frame.K.copy()
    K[0, 2] = frame.shape[1] - 1 - K[0, 2]
    turned = make_frame(rgb=frame.rgb[:, ::-1], depth=frame.points[:, ::-1, 2], K=K)
    mirrored = image_channels(turned.rgb, see_surfaces(turned, 0, SegmentConfig()))[
        ..., ::-1
    ].copy()
    mirrored[SIDEWAYS] *= -1
    same = np.abs(mirrored.astype(int) - image_channels(frame.rgb, seen)) <= 3
    assert same.mean() > 0.97


def test_missing_depth_is_zero(scene):
    depth = scene.depth.copy()
    depth[40:60, 30:70] = np.nan
    frame = make_frame(rgb=scene.rgb, depth=depth, K=scene.K)
    channels = image_channels(frame.rgb, see_surfaces(frame, 0, SegmentConfig()))
    hole = np.s_[:, 42:58, 32:68]
    assert not channels[3:8][hole].any() and not channels[10][hole[1:]].any()
    assert channels[:3][hole].any()
