"""What a notebook shows of a result: HTML that holds its picture."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

WIDTH = 480  # pixels on the page
_QUALITY = 85


def picture_html(picture: NDArray[np.uint8] | bytes, width: int = WIDTH) -> str:
    """An <img> of pixels (H, W, 3), or of the bytes of a PNG, at most `width` wide."""
    if isinstance(picture, bytes):
        kind, data = "png", picture
    else:
        from PIL import Image

        stream = io.BytesIO()
        Image.fromarray(picture).save(stream, "JPEG", quality=_QUALITY)
        kind, data = "jpeg", stream.getvalue()
    text = base64.b64encode(data).decode("ascii")
    return f'<img style="max-width: min({width}px, 100%)" src="data:image/{kind};base64,{text}">'


def table_html(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A <table>; what stands in the cells is text."""
    lines = ["".join(f"<th>{html.escape(cell)}</th>" for cell in head)]
    lines += ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def result_html(title: str, picture: str, table: str = "") -> str:
    """A title above a picture and a table."""
    return f"<div><p><b>{html.escape(title)}</b></p>{picture}{table}</div>"
