"""CLIP's image side before the model: the object's crop, and pixels as CLIP was trained on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame

SIDE = 224
STRETCH = 512
MEAN = np.array([0.48145466, 0.4578275, 0.40821073], dtype=np.float32)
STD = np.array([0.26862954, 0.26130258, 0.27577711], dtype=np.float32)


def object_crop(frame: Frame, object_id: int) -> NDArray[np.uint8]:
    """RGB (h, w, 3) of the bounding box of the object's mask, background included (the paper)."""
    rows, columns = np.nonzero(frame.segmap == object_id)
    if rows.size == 0:
        raise RetrievalError(
            "The mask has no such object",
            where=frame.source,
            expected=", ".join(map(str, frame.object_ids)) or "a mask with objects",
            found=object_id,
            fix="take an id of frame.object_ids",
        )
    return frame.rgb[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]


def stretch(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Crop (h, w, 3) stretched to 512 x 512 whatever its shape, as the authors do.

    So the centre crop of `clip_pixels` loses nothing of a long object.
    """
    return np.asarray(_resize(rgb, STRETCH, STRETCH))


def clip_pixels(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Image (h, w, 3) to CLIP's pixels (3, 224, 224).

    Shortest side to 224 (bicubic, antialiased), centre crop, 0..1, then CLIP's mean and deviation.
    """
    height, width = rgb.shape[:2]
    scale = SIDE / min(height, width)
    resized = _resize(rgb, max(SIDE, int(height * scale)), max(SIDE, int(width * scale)))
    top, left = ((extent - SIDE) // 2 for extent in resized.shape[:2])
    square = resized[top : top + SIDE, left : left + SIDE].astype(np.float32) / 255
    return np.ascontiguousarray(((square - MEAN) / STD).transpose(2, 0, 1))


def _resize(rgb: NDArray[np.uint8], height: int, width: int) -> NDArray[Any]:
    image = import_library("PIL.Image")
    # Pillow's bicubic widens its kernel when it shrinks an image: the antialias CLIP asks for.
    return np.asarray(image.fromarray(rgb).resize((width, height), image.Resampling.BICUBIC))
