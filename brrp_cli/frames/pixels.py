"""Image files to arrays: colour, depth and masks."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from brrp_cli.errors import FrameError
from brrp_cli.files import exists
from brrp_cli.frames.arrays import check_file, read_npy
from brrp_cli.frames.metres import MAX_PIXELS
from brrp_cli.frames.misplaced import JOIN_MASKS

# What holds masks, but not as one map of ids.
_OTHER_MASKS = {
    ".json": "JSON, such as COCO's annotations",
    ".npz": "an .npz file of several arrays",
}
# Pillow's modes of one number a pixel that is wide enough for depth.
_WIDE = ("I;16", "I;16B", "I;16L", "I;16N", "I", "F")


def decode(source: Path | BytesIO, mode: str | None) -> tuple[NDArray[Any], str]:
    """The pixels of an image file, converted to Pillow's `mode`, and the mode that they had.

    Errors: FrameError, whatever the bytes are.
    """
    where = source if isinstance(source, Path) else None
    try:
        with _own_limit(), Image.open(source) as image:
            if image.width * image.height > MAX_PIXELS:
                raise _too_large(where, f"{image.width} x {image.height}")
            return np.asarray(image.convert(mode) if mode else image), image.mode
    except FrameError:
        raise
    except Image.DecompressionBombError as error:
        raise _too_large(where, str(error).split(",")[0]) from error
    except Exception as error:
        # Pillow's readers raise whatever the damaged file made them stumble over.
        raise FrameError(
            "The image cannot be read",
            where=where,
            expected="a whole PNG, JPEG or TIFF",
            found=str(error) if where else "bytes that are no such image",
            fix="it is damaged, cut short or not what its name says: write or fetch it again",
        ) from error


def _too_large(where: Path | None, found: str) -> FrameError:
    return FrameError(
        "The image is larger than the limit",
        where=where,
        expected=f"at most {MAX_PIXELS} pixels (4096 x 4096)",
        found=found,
        fix="scale the images down, depth by nearest neighbour, and the intrinsics with them",
    )


@contextmanager
def _own_limit() -> Iterator[None]:
    """Without Pillow's warning of a large image: what is too large here is an error anyway."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        yield


def _open(path: Path, mode: str | None) -> tuple[NDArray[Any], str]:
    check_file(path)
    return decode(path, mode)


def read_colour(path: Path) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 of an image file. Errors: FrameError."""
    check_file(path)
    return decode_colour(path)


def decode_colour(source: Path | BytesIO) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 of an image. Errors: FrameError, also for one wide number a pixel, of which
    nobody tells where it is white: Pillow would make white of all above 255."""
    colour, mode = decode(source, "RGB")
    if mode in _WIDE:
        raise FrameError(
            "The colour image has one wide number a pixel",
            where=source if isinstance(source, Path) else None,
            expected="8 bits a channel, colour or grey",
            found=f"Pillow mode {mode}",
            fix="scale it to 0 to 255 and save it as an 8-bit image; if it is depth, pass it as"
            " such",
        )
    return colour.astype(np.uint8)


def read_depth(path: Path) -> NDArray[Any]:
    """(H, W) raw depth of a 16-bit PNG, a TIFF or an .npy file, in the file's own unit.

    Errors: FrameError, also for 8-bit and colour images, which are pictures of depth.
    """
    if path.suffix == ".npy":
        return read_npy(path)
    depth, mode = _open(path, None)
    if mode not in _WIDE:
        raise FrameError(
            "The depth image is a picture, not depth",
            where=path,
            expected="one 16-bit or float number a pixel",
            found=f"Pillow mode {mode}",
            fix="save raw depth as a 16-bit PNG in millimetres, or as .npy",
        )
    return depth


def read_masks(path: Path) -> NDArray[Any]:
    """(H, W) object ids of an .npy file or an image of one number (or palette index) a pixel.

    Errors: FrameError, also for single masks, which are to be joined.
    """
    if exists(path) and path.is_dir():
        raise _no_map(path, "a folder")
    check_file(path)
    if path.suffix.lower() in _OTHER_MASKS:
        raise _no_map(path, _OTHER_MASKS[path.suffix.lower()])
    if path.suffix == ".npy":
        ids = read_npy(path)
        if ids.ndim != 2 and not (ids.ndim == 3 and ids.shape[-1] == 1):
            raise _no_map(path, f"shape {ids.shape}")
        return ids
    if path.suffix.lower() in (".jpg", ".jpeg"):
        raise FrameError(
            "The mask image is a JPEG, which does not keep ids",
            where=path,
            expected="a grey PNG or .npy",
            fix="write the masks anew: a JPEG's edges hold ids that nobody gave",
        )
    masks, mode = _open(path, None)
    if masks.ndim != 2:
        raise FrameError(
            "The mask image has colours, not ids",
            where=path,
            expected="one number a pixel: 0 = background, any other id is an object",
            found=f"Pillow mode {mode}",
            fix="save the ids as an 8-bit or 16-bit grey PNG, or as .npy",
        )
    return masks


def _no_map(path: Path, found: str) -> FrameError:
    return FrameError(
        "The masks are not one map of ids",
        where=path,
        expected="one grey PNG or .npy (H, W) with the ids of all objects, 0 = background",
        found=found,
        fix=f"{JOIN_MASKS}; np.save('masks.npy', ids)",
    )
