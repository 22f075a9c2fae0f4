"""Masks that recognised objects claim and give back, and what that changes reconstructed again."""

from __future__ import annotations

from collections.abc import Collection

from brrp_cli.config.mending import MendConfig
from brrp_cli.mending.again import Again, replaced
from brrp_cli.mending.explain import measured, rendered, tolerance
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import Reconstruction
from brrp_cli.segmentation.mend_masks import Mended, Placed, mend_masks


def claim(
    result: Reconstruction,
    prior: Prior,
    again: Again,
    config: MendConfig,
    first_free: int = 1,
    corrected: Collection[int] = (),
) -> Reconstruction:
    """The reconstruction after recognised objects claimed masks that they explain and gave back
    pixels that they do not (segmentation/mend_masks.py), in `config.rounds` rounds at most.

    first_free : ids of new objects are this at least; corrected : ids of masks that stay as they
    are
    """
    for _ in range(config.rounds):
        mended = mended_masks(result, prior, config, first_free, corrected)
        if mended.segmap is result.frame.segmap:
            break
        frame = result.frame.with_masks(mended.segmap)
        result = replaced(result, frame, mended.changed, again)
    return result


def mended_masks(
    result: Reconstruction,
    prior: Prior,
    config: MendConfig,
    first_free: int = 1,
    corrected: Collection[int] = (),
) -> Mended:
    """The frame's masks, mended by the objects that were recognised in it; those of the ids
    `corrected` stay."""
    frame = result.frame
    placed = [
        Placed(item.object_id, float(found.weight or 0.0), rendered(found, prior, frame))
        for item in result.objects
        if item.object_id not in corrected
        and (found := item.recognised) is not None
        and found.T_cam_object is not None
    ]
    height = None if result.plane is None else result.plane.signed_distance(frame.points)
    near = tolerance(frame, config)
    return mend_masks(
        frame.segmap, measured(frame), placed, height, near, config, first_free, corrected
    )
