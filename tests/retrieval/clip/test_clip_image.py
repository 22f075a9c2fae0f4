import numpy as np
import pytest

from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.clip.image import clip_pixels, object_crop, stretch

MEAN = np.array([0.48145466, 0.4578275, 0.40821073])
STD = np.array([0.26862954, 0.26130258, 0.27577711])


def test_the_crop_is_the_masks_box(coloured_frame: Frame) -> None:
    crop = object_crop(coloured_frame, 250)
    assert crop.shape == (12, 20, 3)
    assert (crop == (0, 255, 0)).all()


def test_the_crop_includes_background_inside_the_box(coloured_frame: Frame) -> None:
    segmap = coloured_frame.segmap.copy()
    segmap[segmap == 7] = 0
    segmap[5, 6] = segmap[9, 16] = 7
    frame = Frame(coloured_frame.rgb, coloured_frame.points, segmap, coloured_frame.K)
    assert np.array_equal(object_crop(frame, 7), coloured_frame.rgb[5:10, 6:17])


def test_an_absent_object_is_refused(coloured_frame: Frame) -> None:
    with pytest.raises(RetrievalError, match="3, 7, 250"):
        object_crop(coloured_frame, 8)


@pytest.mark.parametrize("shape", [(1, 1), (3, 90), (512, 512), (300, 225)])
def test_one_colour_becomes_its_normalised_value(shape: tuple[int, int]) -> None:
    colour = np.array([255, 128, 3], dtype=np.uint8)
    pixels = clip_pixels(stretch(np.broadcast_to(colour, (*shape, 3))))
    assert pixels.shape == (3, 224, 224)
    assert pixels.dtype == np.float32
    assert np.allclose(pixels, ((colour / 255 - MEAN) / STD)[:, None, None], atol=1e-6)


def test_left_right_top_and_bottom_stay_where_they_are() -> None:
    rgb = np.zeros((40, 100, 3), dtype=np.uint8)
    rgb[:, 50:, 0] = 255
    rgb[20:, :, 2] = 255
    pixels = clip_pixels(stretch(rgb)) * STD[:, None, None] + MEAN[:, None, None]
    # Resampling blends a few pixels at each edge and leaves the rest as it was.
    assert np.allclose(pixels[0, :, :100], 0, atol=1e-6)
    assert np.allclose(pixels[0, :, 124:], 1, atol=1e-6)
    assert np.allclose(pixels[2, :100], 0, atol=1e-6)
    assert np.allclose(pixels[2, 124:], 1, atol=1e-6)
    assert np.allclose(pixels[1], 0, atol=1e-6)


def test_the_stretched_crop_keeps_the_ends_of_a_long_object() -> None:
    rgb = np.zeros((10, 400, 3), dtype=np.uint8)
    rgb[:, :40] = rgb[:, -40:] = 255
    assert clip_pixels(stretch(rgb))[0, 112, [2, -3]].min() > 1.5
    assert clip_pixels(rgb)[0].max() < 0


def test_the_centre_is_cropped_from_an_image_that_is_not_square() -> None:
    rgb = np.zeros((224, 424, 3), dtype=np.uint8)
    rgb[:, 100:324] = np.arange(224, dtype=np.uint8)[None, :, None]
    pixels = clip_pixels(rgb) * STD[:, None, None] + MEAN[:, None, None]
    assert np.allclose(pixels[0] * 255, np.arange(224)[None], atol=1e-3)


def test_shrinking_averages_fine_stripes() -> None:
    rgb = np.zeros((896, 896, 3), dtype=np.uint8)
    rgb[:, ::2] = 255
    pixels = clip_pixels(rgb)[0] * STD[0] + MEAN[0]
    assert np.abs(pixels[:, 8:-8] - 0.5).max() < 0.02
