"""Whether anything in view of a camera that stands has changed."""

from __future__ import annotations

import numpy as np

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.dilate import opened
from brrp_cli.frames.frame import Frame
from brrp_cli.tracking.motion import camera_motion, noisier, stands


def unchanged(before: Frame, now: Frame, config: TrackConfig) -> bool:
    """Whether no group of pixels as large as an object has another depth, or another colour, in two
    images of one camera that stands. What creeps does not change between two frames: hold the
    newest one to the one that masks were made of."""
    T_now_before = camera_motion(before, now, config)
    if T_now_before is None or not stands(T_now_before, config) or before.shape != now.shape:
        return False
    own = config.carry
    with np.errstate(invalid="ignore"):
        apart = np.abs(now.depth - before.depth) > own.gap * noisier(before.depth)
    other = np.abs(now.rgb.astype(np.int16) - before.rgb).mean(axis=-1) > config.colour
    changed = apart & before.valid & now.valid | other
    # Borders waver: what is thin is none of an object.
    return not changed.any() or int(opened(changed, own.opening).sum()) < own.least_pixels
