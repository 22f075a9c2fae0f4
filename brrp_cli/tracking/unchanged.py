"""Whether anything in view of a camera that stands has changed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.dilate import dilated, opened
from brrp_cli.frames.frame import Frame
from brrp_cli.tracking.motion import camera_motion, camera_stands, noisier

Mask = NDArray[np.bool_]


def unchanged(before: Frame, now: Frame, config: TrackConfig) -> bool:
    """Whether no group of pixels as large as an object has another depth, or another colour, in two
    images of one camera that stands, and few do at the borders of the first one's masks, where an
    object shows that it slides. What creeps does not change between two frames: hold the newest one
    to the one that masks were made of."""
    T_now_before = camera_motion(before, now, config)
    if T_now_before is None or not camera_stands(T_now_before, config) or before.shape != now.shape:
        return False
    changed = changed_pixels(before, now, config)
    # Borders waver: what is thin is none of an object.
    own = config.carry
    if changed.any() and opened(changed, own.opening).sum() >= own.least_pixels:
        return False
    return not any(slides(before.segmap == i, changed, config) for i in before.object_ids)


def changed_pixels(before: Frame, now: Frame, config: TrackConfig) -> Mask:
    """Pixels (H, W) that have another depth, or another colour, in two images of one camera that
    stands."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(now.depth - before.depth) > config.carry.gap * noisier(before.depth)
    other = np.abs(now.rgb.astype(np.int16) - before.rgb).mean(axis=-1) > config.colour
    return np.asarray(apart & before.valid & now.valid | other)


def slides(mask: Mask, changed: Mask, config: TrackConfig) -> bool:
    """Whether so much has changed in a mask (H, W) and at its borders that its object slides."""
    around = dilated(mask, config.carry.opening)
    return bool((changed & around).sum() > (1 - config.still_mask) * mask.sum())
