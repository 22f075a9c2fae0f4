"""The colours of a mesh: the stored object's own, else what the camera saw, and a plain guess
behind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import depth_behind, pixel_numbers
from brrp_cli.reconstruction import Surface

# A vertex has the colour of its pixel if the depth there is this close to its own, metres.
SEEN_WITHIN = 0.012


def surface_colours(surface: Surface, frame: Frame, object_id: int) -> NDArray[np.uint8]:
    """RGB (n, 3) of a surface's vertices, metres, camera frame."""
    if surface.colours is not None:
        return surface.colours
    return seen_colours(surface.vertices, frame, object_id)


def seen_colours(vertices: NDArray[np.floating], frame: Frame, object_id: int) -> NDArray[np.uint8]:
    """Colours (n, 3) of vertices (n, 3), metres, camera frame: of the pixel that saw the vertex,
    else the object's median colour."""
    mask = frame.segmap == object_id
    typical = np.median(frame.rgb[mask], axis=0) if mask.any() else np.full(3, 128)
    colours = np.tile(np.asarray(typical, dtype=np.uint8), (len(vertices), 1))
    pixel, inside = pixel_numbers(vertices, frame)
    # NaN, no return, compares as false.
    seen = inside & mask.ravel()[pixel] & (np.abs(depth_behind(vertices, frame)) < SEEN_WITHIN)
    colours[seen] = frame.rgb.reshape(-1, 3)[pixel[seen]]
    return colours
