"""What the network that parts objects looks at: colour and geometry of a frame, made smaller."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.segmentation.seen_surfaces import SeenSurfaces

# All numbers here are as the network was trained: others ask for another training.
# Colour (3), height, normal (3), rise of the normal, hollow crease, jump, depth is there.
CHANNELS = 11
COLOURS = slice(0, 3)
NORMALS = slice(4, 7)
# What turns round when the image is mirrored: x of the normals.
SIDEWAYS = NORMALS.start
# Images are made smaller by a whole number, so that their shorter side has at least so many pixels.
LEAST_SIDE = 240
# Height in these metres is 1; what lies lower or higher than that is cut.
_HEIGHT, _LOWEST, _HIGHEST = 0.15, -0.2, 2.0
_SHARP = 90.0


def step_of(shape: tuple[int, int]) -> int:
    """Pixels of an image (H, W) that become one along each axis."""
    return max(1, min(shape) // LEAST_SIDE)


def image_channels(rgb: NDArray[np.uint8], seen: SeenSurfaces) -> NDArray[np.int8]:
    """(CHANNELS, h, w), 1 as 63, of colour (H, W, 3) and what was seen; 0 where depth is missing.

    Colour is the mean over the pixels that become one, geometry that of one of them.
    """
    step = step_of(rgb.shape[:2])
    rows, columns = (size // step for size in rgb.shape[:2])
    window = np.s_[: rows * step, : columns * step]
    # Image by image: many times as fast as a mean over axes of two.
    total = np.zeros((rows, columns, 3), np.uint32)
    for i, j in np.ndindex(step, step):
        total += rgb[window][i::step, j::step]
    colour = total / np.float32(127.5 * step**2) - 1
    near = np.s_[step // 2 : rows * step : step, step // 2 : columns * step : step]
    normals = seen.normals[near]
    channels = np.concatenate(
        [
            colour,
            np.clip(seen.height[near] / _HEIGHT, _LOWEST, _HIGHEST)[..., None],
            normals,
            (normals @ seen.table.plane.normal)[..., None],
            (seen.angles[near] / _SHARP)[..., None],
            seen.jumps[near][..., None],
            seen.valid[near][..., None],
        ],
        axis=-1,
    )
    channels = np.rint(63 * np.nan_to_num(np.moveaxis(channels, -1, 0)))
    return np.ascontiguousarray(np.clip(channels, -127, 127).astype(np.int8))
