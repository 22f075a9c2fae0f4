"""preview.png: the input beside the reconstruction, from the camera and from behind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import IMAGE_UP
from brrp_cli.reconstruction import ObjectReconstruction
from brrp_cli.rendering.framing import near_others, shown_whole
from brrp_cli.rendering.render import PinholeView, fitted, render, view_from_behind
from brrp_cli.segmentation.mask_picture import draw_masks, object_colours
from brrp_cli.spoken import NOT_STORED
from brrp_cli.surface.colours import (
    scale_top,
    spread,
    spread_colours,
    spread_label,
    spread_meaning,
)
from brrp_cli.surface.painting import surface_colours

Picture = NDArray[np.uint8]

PANEL_WIDTH = 480
CAPTION = 28
SMALLEST = 8  # type of the list
INDENT = 26  # pixels, of the list's text
INK = (30, 30, 30)
LEAST = 0.005  # of weights and probabilities: less reads as 0.00


def preview(
    frame: Frame,
    objects: Sequence[ObjectReconstruction],
    *,
    up: NDArray[np.floating] | None = None,
    caption: str = "objects",
) -> Picture:
    """Six panels (H, W, 3): masks, shapes from the camera and from behind; list, uncertainty.

    up : (3,) the table's normal, camera frame; without one, up in the image
    caption : stands over the list of objects
    """
    view = _panel_view(frame)
    found = [o for o in objects if o.surface is not None]
    surfaces = [o.surface for o in found if o.surface is not None]
    up = IMAGE_UP if up is None else up
    behind = fitted(view_from_behind(view, _middle(objects), up), shown_whole(surfaces))
    top = scale_top(surfaces)
    unsure = [spread_colours(spread(s), top) for s in surfaces]
    shapes = [
        surface_colours(o.surface, frame, o.object_id) for o in found if o.surface is not None
    ]
    masks = draw_masks(frame.rgb, frame.segmap)
    meaning = spread_meaning(surfaces)
    rows = [
        [
            _captioned(_resized(masks, view.shape), "input and masks"),
            _captioned(render(surfaces, shapes, view), "reconstruction, from the camera"),
            _captioned(render(surfaces, shapes, behind), "from behind"),
        ],
        [
            _captioned(_listing(objects, view.shape), caption),
            _captioned(
                render(surfaces, unsure, view),
                f"uncertainty: spread of {meaning}, from the camera",
            ),
            _with_scale(
                _captioned(render(surfaces, unsure, behind), "from behind"),
                top,
                spread_label(top, surfaces),
            ),
        ],
    ]
    return np.vstack([np.hstack(row) for row in rows])


def _panel_view(frame: Frame) -> PinholeView:
    height, width = frame.shape
    factor = PANEL_WIDTH / width
    K = frame.K * np.array([[factor], [factor], [1.0]])
    return PinholeView(K, np.eye(4), (round(height * factor), PANEL_WIDTH))


def _middle(objects: Sequence[ObjectReconstruction]) -> NDArray[np.float64]:
    centers = np.array([o.center for o in objects if o.center is not None])
    return centers[near_others(centers)].mean(axis=0) if len(centers) else np.array([0.0, 0.0, 1.0])


def _resized(picture: Picture, shape: tuple[int, int]) -> Picture:
    from PIL import Image

    height, width = shape
    return np.asarray(Image.fromarray(picture).resize((width, height)))


def _font(size: int) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size)


def _captioned(picture: Picture, text: str) -> Picture:
    from PIL import Image, ImageDraw

    bar = Image.new("RGB", (picture.shape[1], CAPTION), "white")
    ImageDraw.Draw(bar).text((8, 6), text, fill=INK, font=_font(14))
    return np.vstack([np.asarray(bar), picture])


def _listing(objects: Sequence[ObjectReconstruction], shape: tuple[int, int]) -> Picture:
    """For each object id, status and weights in the posterior, and what was retrieved; long lines
    are wrapped, in the largest type in which all of them fit."""
    from PIL import Image, ImageDraw

    height, width = shape
    panel = Image.new("RGB", (width, height), "white")
    draw = ImageDraw.Draw(panel)
    told = [_told(item) for item in objects]
    for size in range(13, SMALLEST - 1, -1):
        font, line = _font(size), size + 4
        blocks = [
            [row for text in pair for row in wrapped(text, font, width - INDENT - 6)]
            for pair in told
        ]
        rows = (height - 6) // line
        if sum(map(len, blocks)) <= rows:
            break
    else:  # too much for any type: every object has its share of the rows
        blocks = [_first(block, max(1, rows // len(blocks))) for block in blocks]
    gap = (height - 6 - line * sum(map(len, blocks))) // max(len(blocks), 1)
    gap = max(0, min(8, gap))
    colours = object_colours([item.object_id for item in objects])
    y = 4
    for item, block in zip(objects, blocks, strict=True):
        draw.rectangle((8, y + 1, 20, y + 13), fill=tuple(int(c) for c in colours[item.object_id]))
        for row in block:
            draw.text((INDENT, y), row, fill=INK, font=font)
            y += line
        y += gap
    return np.asarray(panel)


def _first(rows: list[str], count: int) -> list[str]:
    return rows if len(rows) <= count else [*rows[: count - 1], rows[count - 1][:-3] + "..."]


def wrapped(text: str, font: Any, width: int) -> list[str]:
    """The text in rows of at most `width` pixels, broken between words, and within a word that is
    wider than a row."""
    rows = [""]
    for word in text.split(" "):
        longer = f"{rows[-1]} {word}".strip()
        if font.getlength(longer) <= width:
            rows[-1] = longer
            continue
        if rows[-1]:
            rows.append("")
        for letter in word:
            if font.getlength(rows[-1] + letter) > width and rows[-1]:
                rows.append("")
            rows[-1] += letter
    return rows


def _told(item: ObjectReconstruction) -> tuple[str, str]:
    first = f"{item.object_id}: {item.status}"
    weights = [(r.weight, r.name) for r in item.retrieved if r.weight is not None]
    if weights:
        first += f"; weights {_ranked(weights, item.unknown_weight or 0.0)}"
    shares = [(r.probability, r.name) for r in item.retrieved]
    return first, _ranked(shares, item.unknown_probability) if shares else item.message


def _ranked(shares: list[tuple[float, str]], none: float) -> str:
    """Names with their shares, largest first: the largest, and what is at least LEAST."""
    ranked = sorted([*shares, (none, NOT_STORED)], key=lambda each: -each[0])
    told = [each for each in ranked if each[0] >= LEAST] or ranked[:1]
    return ", ".join(f"{name} {share:.2f}" for share, name in told)


def _with_scale(panel: Picture, top: float, label: str) -> Picture:
    """The panel with a colour bar in its caption, from 0 to the spread `top`, which reads `label`.

    In the picture it would hide what lies there.
    """
    from PIL import Image, ImageDraw

    image = Image.fromarray(panel)
    length = image.width // 3
    left = image.width - length - 70
    bar = np.tile(spread_colours(np.linspace(0, top, length), top)[:, :3], (10, 1, 1))
    image.paste(Image.fromarray(bar), (left, 9))
    draw = ImageDraw.Draw(image)
    draw.text((left - 6, 7), "0", fill=INK, font=_font(12), anchor="ra")
    draw.text((left + length + 6, 7), label, fill=INK, font=_font(12))
    return np.asarray(image)
