"""Some objects of a frame reconstructed again, with other masks."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Protocol

from brrp_cli.config.registration import TrialConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.reconstruction import Reconstruction


class Again(Protocol):
    """Reconstructs those objects of a frame whose ids are given."""

    def __call__(
        self, frame: Frame, only: Collection[int], /, *, trial: TrialConfig | None = None
    ) -> Reconstruction:
        """trial : only looks which stored objects lie there"""


def replaced(
    result: Reconstruction, frame: Frame, changed: Collection[int], again: Again
) -> Reconstruction:
    """What was made of the objects of `frame`, which has other masks, where those of the ids
    `changed` are not what they were."""
    asked = set(changed) & set(frame.object_ids)
    stay = set(frame.object_ids) - asked
    kept = [each for each in result.objects if each.object_id in stay]
    result = again(frame, asked) if asked else replace(result, frame=frame)
    objects = [*kept, *(each for each in result.objects if each.object_id in asked)]
    return replace(result, objects=sorted(objects, key=lambda each: each.object_id))
