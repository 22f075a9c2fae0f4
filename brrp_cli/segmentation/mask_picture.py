"""A picture of the masks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from brrp_cli.errors import OutputError
from brrp_cli.files import atomic_path
from brrp_cli.frames.frame import BACKGROUND, Frame

# Okabe and Ito's colours, which people with any colour vision can tell apart.
PALETTE = np.array(
    [
        (230, 159, 0),
        (86, 180, 233),
        (0, 158, 115),
        (240, 228, 66),
        (0, 114, 178),
        (213, 94, 0),
        (204, 121, 167),
    ],
    dtype=np.uint8,
)
# The same darker and lighter, where there are more objects than colours.
_SHADES = ((0.0, 0), (0.45, 0), (0.5, 255))
_FILL = 0.45


def object_colours(object_ids: list[int]) -> dict[int, NDArray[np.uint8]]:
    """A colour (3,) uint8 for each id, by its place in the list; 21 of them differ."""
    return {i: _colour(place) for place, i in enumerate(object_ids)}


def _colour(place: int) -> NDArray[np.uint8]:
    again, number = divmod(place, len(PALETTE))
    share, towards = _SHADES[again % len(_SHADES)]
    return np.asarray((1 - share) * PALETTE[number] + share * towards).round().astype(np.uint8)


def draw_masks(rgb: NDArray[np.uint8], segmap: NDArray[np.integer]) -> NDArray[np.uint8]:
    """The image (H, W, 3) with each object filled, outlined and named by its id.

    rgb : (H, W, 3) uint8; segmap : (H, W), 0 = background. Neither is changed.
    """
    picture = rgb.copy()
    ids = [int(i) for i in np.unique(segmap) if i != BACKGROUND]
    for object_id, colour in object_colours(ids).items():
        mask = segmap == object_id
        mixed = (1 - _FILL) * rgb[mask] + _FILL * colour
        picture[mask] = mixed.astype(np.uint8)
        picture[_outline(mask)] = colour
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(size=max(12, min(segmap.shape) // 24))
    for object_id in ids:
        draw.text(
            _middle(segmap == object_id),
            str(object_id),
            fill="white",
            font=font,
            anchor="mm",
            stroke_width=2,
            stroke_fill="black",
        )
    return np.asarray(image)


def write_picture(frame: Frame, path: Path) -> None:
    """Write `draw_masks` of the frame as an image file. Errors: OutputError."""
    with atomic_path(path) as partial:
        Image.fromarray(draw_masks(frame.rgb, frame.segmap)).save(partial)


def write_ids(frame: Frame, path: Path) -> None:
    """Write the ids as a 16-bit grey PNG, 0 = background, as `--masks` reads them.

    Errors: OutputError, also for ids that 16 bits do not hold (`fits_ids`).
    """
    if not fits_ids(frame):
        raise OutputError(
            "An id does not fit a 16-bit image",
            where=path,
            expected="0 to 65535",
            found=f"{frame.segmap.min()} to {frame.segmap.max()}",
        )
    with atomic_path(path) as partial:
        Image.fromarray(frame.segmap.astype(np.uint16)).save(partial)


def fits_ids(frame: Frame) -> bool:
    """Whether 16 bits hold all ids."""
    return bool(frame.segmap.min() >= 0 and frame.segmap.max() < 2**16)


def _outline(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels of the mask with a neighbour (of four) outside it; the image's border is outside."""
    padded = np.pad(mask, 1)
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return mask & ~inner


def _middle(mask: NDArray[np.bool_]) -> tuple[float, float]:
    """(u, v) of the mask's pixel nearest to its centroid, so that the label lies on the object."""
    v, u = np.nonzero(mask)
    nearest = int(np.argmin((u - u.mean()) ** 2 + (v - v.mean()) ** 2))
    return float(u[nearest]), float(v[nearest])
