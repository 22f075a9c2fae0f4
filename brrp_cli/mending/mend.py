"""Masks that were made on the way, mended by all that is recognised."""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.mending.again import Again
from brrp_cli.mending.claim import claim
from brrp_cli.mending.regroup import regroup
from brrp_cli.mending.strangers import without_strangers
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import Reconstruction


def mend(
    result: Reconstruction,
    prior: Prior | None,
    again: Again,
    config: SegmentConfig,
    aside: NDArray[np.integer] | None = None,
    asked: Collection[int] | None = None,
    first_free: int = 1,
    corrected: Collection[int] = (),
) -> Reconstruction:
    """The reconstruction with masks that recognised objects claimed (claim.py), and that were
    regrouped where that lets one be recognised (regroup.py), which then claims its own. What was
    left out and is not recognised has no mask (strangers.py).

    again : reconstructs those objects of a frame whose ids are given
    aside : (H, W) masks that were left out, 0 = none; asked : ids whose masks may be regrouped,
    None = all; first_free : ids of new objects are this at least; corrected : ids of masks that
    stay as they are
    Its frame has the masks as they were mended; without a prior nothing is recognised. `seconds`
    gains "mending".

    Errors: FrameError if no mask is left.
    """
    if prior is None:
        return result if aside is None else without_strangers(result, aside, config)
    start, first = time.perf_counter(), dict(result.seconds)
    before = set(result.frame.object_ids)
    mended = claim(result, prior, again, config.mend, first_free, corrected)
    if asked is not None or corrected:
        asked = set(before if asked is None else asked) | (set(mended.frame.object_ids) - before)
        asked -= set(corrected)
    grouped = regroup(mended, prior, again, config, aside, asked, first_free)
    if grouped is not mended:
        mended = claim(grouped, prior, again, config.mend, first_free, corrected)
    if aside is not None:
        mended = without_strangers(mended, aside, config)
    return replace(mended, seconds={**first, "mending": time.perf_counter() - start})
