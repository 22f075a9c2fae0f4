"""Some objects of a frame reconstructed again, with other masks."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.registration import TrialConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction


class Objects(Protocol):
    """Reconstructs the objects of a frame whose ids are given; image : as in `Setup`."""

    def __call__(self, frame: Frame, *, only: Collection[int], image: Any = None) -> Reconstruction:
        """See above."""


class Masks(Protocol):
    """Looks which stored objects lie in each of other masks (H, W) of a frame."""

    def __call__(
        self,
        frame: Frame,
        masks: Sequence[NDArray[np.bool_]],
        trial: TrialConfig,
        *,
        image: Any = None,
    ) -> list[ObjectReconstruction]:
        """See above."""


@dataclass(frozen=True)
class Again:
    """How a frame is looked at once more."""

    objects: Objects
    masks: Masks


def replaced(
    result: Reconstruction, frame: Frame, changed: Collection[int], again: Again
) -> Reconstruction:
    """What was made of the objects of `frame`, which has other masks, where those of the ids
    `changed` are not what they were."""
    asked = set(changed) & set(frame.object_ids)
    stay = set(frame.object_ids) - asked
    kept = [each for each in result.objects if each.object_id in stay]
    if asked:
        result = again.objects(frame, only=asked, image=result.image)
    else:
        result = replace(result, frame=frame)
    objects = [*kept, *(each for each in result.objects if each.object_id in asked)]
    return replace(result, objects=sorted(objects, key=lambda each: each.object_id))
