"""The fixed frames that are timed, and the same frames with more of something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brrp_cli.demo.scene import make_scene
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import BACKGROUND, Frame

OBJECTS = 4


def four_objects() -> Frame:
    """Four household shapes of the starter prior on a table, 640 x 480, with noise: the frame of
    `brrp demo`, without the mask of its fifth object."""
    return with_objects(make_scene(0).frame, OBJECTS)


def with_objects(frame: Frame, count: int) -> Frame:
    """The first `count` masks of a frame; what the others showed is background."""
    kept = np.isin(frame.segmap, frame.object_ids[:count])
    return replace(frame, segmap=np.where(kept, frame.segmap, BACKGROUND))


def with_pixels(frame: Frame, factor: float) -> Frame:
    """The frame as a camera of `factor` times as many rows and columns sees it, by the nearest
    pixel."""
    height, width = frame.shape
    rows, columns = (
        np.minimum((np.arange(round(n * factor)) + 0.5) / factor, n - 1).astype(np.int64)
        for n in (height, width)
    )
    K = frame.K.copy()
    K[:2] *= factor
    # Pixel centres are whole numbers.
    K[:2, 2] += (factor - 1) / 2
    at = np.ix_(rows, columns)
    return make_frame(
        rgb=frame.rgb[at], segmap=frame.segmap[at], depth=frame.points[..., 2][at], K=K
    )
