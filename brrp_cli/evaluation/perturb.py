"""Frames made worse on purpose: noise of a camera, masks that lie beside their objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.depth_noise.structured_light import add_depth_noise
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import backproject


def with_noise(frame: Frame, rng: np.random.Generator) -> Frame:
    """The frame as a structured-light camera would have seen it."""
    depth = np.where(frame.valid, frame.points[..., 2], 0.0)
    noisy = add_depth_noise(depth, frame.K, rng)
    return replace(frame, points=backproject(noisy, frame.K))


def shift_masks(frame: Frame, pixels: int) -> Frame:
    """The frame with its masks moved to the right (to the left if negative), as in the paper's
    experiment on robustness; what comes in at the edge is background.
    """
    return frame.with_masks(_shifted(frame.segmap, pixels)) if pixels else frame


def _shifted(segmap: NDArray[np.int64], pixels: int) -> NDArray[np.int64]:
    shifted = np.full_like(segmap, BACKGROUND)
    if pixels > 0:
        shifted[:, pixels:] = segmap[:, :-pixels]
    else:
        shifted[:, :pixels] = segmap[:, -pixels:]
    return shifted
