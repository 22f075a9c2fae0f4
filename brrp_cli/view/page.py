"""One HTML page that holds everything it shows: no server, no network."""

from __future__ import annotations

import base64
import html
import io
import json
import re
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from brrp_cli.results.read import StoredResult
from brrp_cli.segmentation.mask_picture import draw_masks
from brrp_cli.view.layers import page_glb
from brrp_cli.view.readout import told

ASSETS = files("brrp_cli.view") / "assets"
_QUALITY = 88
_SLOT = re.compile(r"\{\{(\w+)\}\}")


def page(stored: StoredResult, title: str) -> str:
    """The page as text. Errors: ResultError, FrameError for results that cannot be read."""
    frame = stored.frame
    content = {
        "title": html.escape(title),
        "style": _asset("style.css"),
        "image": _data_uri(frame.rgb),
        "masked": _data_uri(draw_masks(frame.rgb, frame.segmap)),
        "told": script_json(told(stored)),
        "glb": base64.b64encode(page_glb(stored)).decode("ascii"),
        "three": _asset("three.min.js"),
        "viewer": _asset("viewer.js"),
    }
    # In one go: what is put in is not searched for slots.
    return _SLOT.sub(lambda slot: content[slot[1]], _asset("page.html"))


def script_json(value: object) -> str:
    """JSON that ends no script, whatever its strings hold."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def _data_uri(picture: NDArray[np.uint8]) -> str:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "JPEG", quality=_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(stream.getvalue()).decode("ascii")
