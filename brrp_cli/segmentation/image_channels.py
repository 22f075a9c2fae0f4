"""What the network that parts objects looks at: colour and geometry of a frame, made smaller."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from brrp_cli.segmentation.seen_surfaces import SeenSurfaces

T = TypeVar("T", bound=np.generic)

# All numbers here are as the network was trained: others ask for another training.
# Colour (3), height, normal (3), rise of the normal, hollow crease, jump, depth is there.
CHANNELS = 11
COLOURS = slice(0, 3)
NORMALS = slice(4, 7)
# What turns round when the image is mirrored: x of the normals.
SIDEWAYS = NORMALS.start
# All rows and columns.
WHOLE = np.s_[:, :]
# Pixels of the image's shorter side; smaller images are enlarged so many times at most.
SIDE, MOST_ENLARGED = 480, 2.0
# Height in these metres is 1; what lies lower or higher than that is cut.
_HEIGHT, _LOWEST, _HIGHEST = 0.15, -0.2, 2.0
_SHARP = 90.0


def size_of(shape: tuple[int, int]) -> tuple[int, int]:
    """Rows and columns of what the network sees of an image (H, W)."""
    scale = min(SIDE / min(shape), MOST_ENLARGED)
    return round(shape[0] * scale), round(shape[1] * scale)


def resized(values: NDArray[T], size: tuple[int, int]) -> NDArray[T]:
    """(*size, ...) the nearest of each of the values (H, W, ...)."""
    if values.shape[:2] == size:
        return values
    rows, columns = (
        ((np.arange(new) + 0.5) * old / new).astype(np.int64)
        for new, old in zip(size, values.shape[:2], strict=True)
    )
    return values[rows[:, None], columns]


def image_channels(
    rgb: NDArray[np.uint8], seen: SeenSurfaces, box: tuple[slice, slice] = WHOLE
) -> NDArray[np.int8]:
    """(CHANNELS, h, w), 1 as 63, of colour (H, W, 3) and what was seen; 0 where depth is missing.

    Colour is the mean over what becomes one pixel and is around it, geometry the nearest.
    box : rows and columns of (h, w) that are asked for
    """
    size = size_of(rgb.shape[:2])

    def near(values: NDArray[T]) -> NDArray[T]:
        return resized(values, size)[box]

    image = Image.fromarray(rgb).resize(size[::-1], Image.Resampling.BILINEAR)
    colour = np.asarray(image)[box] / np.float32(127.5) - 1
    normals = near(seen.normals).astype(np.float32)
    up = normals @ seen.table.plane.normal.astype(np.float32)
    height = np.clip(near(seen.height) / _HEIGHT, _LOWEST, _HIGHEST)
    planes = [
        *np.moveaxis(colour, -1, 0),
        height,
        *np.moveaxis(normals, -1, 0),
        up,
        near(seen.angles) / _SHARP,
        near(seen.jumps),
        near(seen.valid),
    ]
    channels = np.empty((CHANNELS, *colour.shape[:2]), np.int8)
    for channel, plane in zip(channels, planes, strict=True):
        channel[:] = np.clip(np.rint(63 * np.nan_to_num(plane.astype(np.float32))), -127, 127)
    return channels
