"""What else the parts of a frame could be: joins that nearly were made, and some that nearly were
not."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import Frame
from brrp_cli.segmentation.cut import filled
from brrp_cli.segmentation.part_objects import Parted, part_objects
from brrp_cli.segmentation.rising import rising
from brrp_cli.segmentation.seen_surfaces import see_surfaces

Mask = NDArray[np.bool_]


def parts_of(frame: Frame, seed: int, config: SegmentConfig) -> Parted | None:
    """The parts of a frame; None where no table is seen."""
    try:
        seen = see_surfaces(frame, seed, config)
    except FrameError:
        return None
    import os
    from dataclasses import replace
    aff = replace(config.affinities, colour=float(os.environ.get("TC", "1")))
    return part_objects(frame.rgb, seen, rising(seen, config), aff)


def nearly_joined(
    parted: Parted, segmap: NDArray[np.integer], ids: Collection[int]
) -> list[frozenset[int]]:
    """Of the masks `ids` in (H, W), those that joins bring together, the likeliest first."""
    owner = _owners(parted, segmap)
    groups = {part: frozenset([i]) for part, i in owner.items()}
    found: list[frozenset[int]] = []
    for join in parted.joins:
        both = groups.get(join.first, frozenset()) | groups.get(join.second, frozenset())
        groups[join.first] = both
        if len(both) > 1 and both <= set(ids) and both not in found:
            found.append(both)
    return found


def nearly_apart(
    parted: Parted, segmap: NDArray[np.integer], object_id: int, most: int
) -> list[Mask]:
    """Both sides (H, W) of the last `most` joins inside a mask of (H, W), the last first."""
    owner = _owners(parted, segmap)
    own = {part for part, i in owner.items() if i == object_id}
    groups = {part: frozenset([part]) for part in own}
    sides: list[tuple[frozenset[int], frozenset[int]]] = []
    for join in parted.joins:
        if join.first in groups and join.second in groups:
            sides.append((groups[join.first], groups[join.second]))
            groups[join.first] |= groups[join.second]
        elif join.second in groups:
            # The group goes by the name of what took it in.
            groups[join.first] = groups[join.second]
    mask = segmap == object_id
    labels = filled(mask, np.where(np.isin(parted.parts, list(own)), parted.parts, 0))
    return [np.isin(labels, list(side)) & mask for pair in sides[: -most - 1 : -1] for side in pair]


def _owners(parted: Parted, segmap: NDArray[np.integer]) -> dict[int, int]:
    """The mask that holds most of each part; parts outside of all masks have none."""
    inside = (parted.parts > 0) & (segmap > 0)
    pairs, counts = np.unique(
        np.stack([parted.parts[inside], segmap[inside]]), axis=1, return_counts=True
    )
    order = np.argsort(counts, kind="stable")
    return {int(part): int(i) for part, i in pairs[:, order].T}
