"""Some objects of a frame reconstructed again, with other masks."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.registration import TrialConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction


@dataclass(frozen=True)
class Again:
    """objects : reconstructs those objects of a frame whose ids are given
    masks : looks which stored objects lie in each of other masks (H, W) of a frame
    """

    objects: Callable[[Frame, Collection[int]], Reconstruction]
    masks: Callable[[Frame, Sequence[NDArray[np.bool_]], TrialConfig], list[ObjectReconstruction]]


def replaced(
    result: Reconstruction, frame: Frame, changed: Collection[int], again: Again
) -> Reconstruction:
    """What was made of the objects of `frame`, which has other masks, where those of the ids
    `changed` are not what they were."""
    asked = set(changed) & set(frame.object_ids)
    stay = set(frame.object_ids) - asked
    kept = [each for each in result.objects if each.object_id in stay]
    result = again.objects(frame, asked) if asked else replace(result, frame=frame)
    objects = [*kept, *(each for each in result.objects if each.object_id in asked)]
    return replace(result, objects=sorted(objects, key=lambda each: each.object_id))
