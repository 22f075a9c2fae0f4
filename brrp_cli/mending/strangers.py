"""What was left out of the masks stays out, unless it is recognised."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.segmentation.left_out import border_share
from brrp_cli.segmentation.segment import nothing_stands


def of_left_out(frame: Frame, aside: NDArray[np.integer]) -> frozenset[int]:
    """The ids of a frame's masks that are mostly what was left out, `aside` (H, W), 0 = none."""
    counts = np.bincount(frame.segmap.ravel())
    left_out = np.bincount(frame.segmap[aside != BACKGROUND], minlength=len(counts))
    return frozenset(int(i) for i in np.flatnonzero(2 * left_out > counts) if i != BACKGROUND)


def without_strangers(
    result: Reconstruction, aside: NDArray[np.integer], config: SegmentConfig
) -> Reconstruction:
    """The reconstruction without the masks of what was left out, `aside` (H, W), 0 = none, that
    are taken for no stored object, or not surely enough: an arm that reaches into the image is
    none.

    Errors: FrameError if nothing is left.
    """
    frame = result.frame
    left_out = of_left_out(frame, aside)
    strangers = [
        each.object_id
        for each in result.objects
        if each.object_id in left_out and not _is_known(each, frame, config)
    ]
    if not strangers:
        return result
    segmap = np.where(np.isin(frame.segmap, strangers), BACKGROUND, frame.segmap)
    if not segmap.any():
        raise nothing_stands(frame)
    objects = [each for each in result.objects if each.object_id not in strangers]
    return replace(result, frame=frame.with_masks(segmap), objects=objects)


def _is_known(item: ObjectReconstruction, frame: Frame, config: SegmentConfig) -> bool:
    """Whether an object is recognised with the weight that its mask asks for: what the image's
    border cuts is a part of something."""
    cut = border_share(frame.segmap == item.object_id) > config.left_out.cut
    least = config.regroup.sure if cut else config.regroup.whole
    return item.recognised is not None and (item.recognised.weight or 0.0) >= least
