"""Masks that were mended in this frame, under the ids of the tracks that they show."""

from __future__ import annotations

from collections.abc import Collection
from itertools import count

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.tracking.followed import Followed
from brrp_cli.tracking.lost import Lost, found_again


def new_names(
    last: Followed, frame: Frame, mended: Collection[int], next_id: int, config: TrackConfig
) -> dict[int, int]:
    """Id -> id of its track, for those of the `mended` masks that show another one than they are
    called after. What was cut out of a mask and is not known keeps its id if no track has it.

    next_id : the first id that is free
    """
    asked = sorted(set(mended) & set(frame.object_ids))
    held = set(frame.object_ids) - set(asked)
    tracks = [*(Lost(last.frame, i) for i in last.frame.object_ids), *last.lost]
    names = found_again([t for t in tracks if t.object_id not in held], frame, asked, config)
    taken = held | set(names.values())
    free = count(max([next_id, *(i + 1 for i in frame.object_ids)]))
    for each in asked:
        if each not in names:
            names[each] = next(free) if each in taken else each
            taken.add(names[each])
    return {old: new for old, new in names.items() if old != new}


def with_names(frame: Frame, names: dict[int, int]) -> Frame:
    """The frame with other ids."""
    segmap = frame.segmap.copy()
    for old, new in names.items():
        segmap[frame.segmap == old] = new
    return frame.with_masks(segmap)
