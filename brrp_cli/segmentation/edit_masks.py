"""Masks corrected by hand: by the ids that a picture shows."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.dependencies import import_library
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.seeds import child_seed
from brrp_cli.segmentation.cut import boundary_of, cut_at_strongest, filled

log = logging.getLogger(__name__)


def corrected(frame: Frame, segmap: NDArray[np.int64]) -> Frame:
    """The frame with masks (H, W) that somebody corrected. Where brrp made its masks, those that
    are not what they were stay so from then on, and what has none stays without; what is
    recognised mends the others."""
    if frame.aside is None:
        return frame.with_masks(segmap)
    changed = segmap != frame.segmap
    theirs = {*frame.corrected, *segmap[changed].tolist(), *frame.segmap[changed].tolist()}
    theirs &= {*np.unique(segmap).tolist()} - {BACKGROUND}
    known = changed | np.isin(segmap, [*theirs])
    return frame.with_masks(segmap, np.where(known, BACKGROUND, frame.aside), frozenset(theirs))


def merge(frame: Frame, ids: Sequence[int]) -> NDArray[np.int64]:
    """Masks (H, W) in which the objects have the first one's id. Errors: FrameError."""
    _known(frame, ids)
    return np.where(np.isin(frame.segmap, list(ids)), ids[0], frame.segmap)


def drop(frame: Frame, ids: Sequence[int]) -> NDArray[np.int64]:
    """Masks (H, W) in which the objects are background. Errors: FrameError."""
    _known(frame, ids)
    return np.where(np.isin(frame.segmap, list(ids)), BACKGROUND, frame.segmap)


def split(
    frame: Frame,
    object_id: int,
    pieces: int = 2,
    seed: int = 0,
    config: SegmentConfig | None = None,
) -> NDArray[np.int64]:
    """Masks (H, W) in which an object is that many; new ones have ids above all others, the
    largest keeps its own.

    It is cut where the boundary (jumps of depth, borders that the network sees) is strongest; where
    it has no inner boundary, into groups of near points. Errors: FrameError.
    """
    _known(frame, [object_id])
    mask = (frame.segmap == object_id) & frame.valid
    if mask.sum() < pieces:
        raise FrameError("The object has too few points with depth", where=frame.source)
    config = config or SegmentConfig()
    parts = cut_at_strongest(mask, boundary_of(frame, seed, config), pieces, config)
    if parts is None:
        log.info("Object %d has no such boundary inside: it is cut by nearness", object_id)
        parts = _by_nearness(frame, mask, pieces, seed)
    return _renumbered(frame.segmap, object_id, parts)


def _by_nearness(
    frame: Frame, mask: NDArray[np.bool_], pieces: int, seed: int
) -> NDArray[np.int64]:
    vq = import_library("scipy.cluster.vq")
    points = frame.points[mask].astype(np.float64)
    _, labels = vq.kmeans2(points, pieces, minit="++", seed=child_seed(seed, "split"))
    parts = np.zeros(frame.shape, np.int64)
    parts[mask] = labels + 1
    return parts


def _renumbered(
    segmap: NDArray[np.int64], object_id: int, parts: NDArray[np.int64]
) -> NDArray[np.int64]:
    mask = segmap == object_id
    whole = filled(mask, parts)
    labels, sizes = np.unique(whole[mask], return_counts=True)
    split = segmap.copy()
    for new, label in enumerate(labels[np.argsort(-sizes, kind="stable")]):
        split[whole == label] = object_id if new == 0 else int(segmap.max()) + new
    return split


def _known(frame: Frame, ids: Sequence[int]) -> None:
    strangers = [i for i in ids if i not in frame.object_ids]
    if strangers:
        raise FrameError(
            "The masks have no such object",
            where=frame.source,
            expected=", ".join(map(str, frame.object_ids)) or "masks with objects",
            found=", ".join(map(str, strangers)),
            fix="take ids of the picture NAME.masks.png, which brrp segment writes; splits come"
            " first, then merges, then drops",
        )
