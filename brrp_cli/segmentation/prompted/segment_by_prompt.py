"""Masks of what a phrase names, freed by depth of what a learned mask takes in besides."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import PromptConfig, SegmentConfig
from brrp_cli.dependencies import import_library
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.segmentation.prompted.detector import Detections, Detector, phrases
from brrp_cli.segmentation.prompted.mask_files import find_mask_files
from brrp_cli.segmentation.prompted.segmenter import Segmenter
from brrp_cli.segmentation.smooth_depth import flying_pixels
from brrp_cli.segmentation.table_plane import find_table
from brrp_cli.spoken import counted

log = logging.getLogger(__name__)


class PromptSegmenter:
    """Detector and segmenter, loaded once for any number of frames.

    folder : where the models lie, None = where `brrp fetch masks` puts them

    Errors: MaskError if they are missing or not the right ones.
    """

    def __init__(self, folder: Path | None = None, config: SegmentConfig | None = None) -> None:
        self._config = config or SegmentConfig()
        files = find_mask_files(folder)
        self._detector = Detector(files.detector, files.tokenizer)
        self._segmenter = Segmenter(files.encoder, files.decoder)

    def __call__(self, frame: Frame, prompt: str, seed: int = 0) -> NDArray[np.int64]:
        """Masks (H, W) of what the prompt names: 1, 2, ... from left to right; 0 is background.

        Where masks overlap the smaller one is in front: a pen lies in the cup, not the cup around
        the pen. Errors: MaskError for an empty prompt; FrameError if nothing is found.
        """
        named, config = phrases(prompt), self._config.prompt
        found = [self._detector(frame.rgb, name, config.threshold) for name in named]
        boxes = _apart(_small(found, frame.shape, config), config.overlap)
        log.info("Detected: %d boxes for %s", len(boxes), ", ".join(map(repr, named)))
        masks = list(self._segmenter(frame.rgb, boxes)[0]) if len(boxes) else []
        return layered(masks, frame, seed, self._config)


def _small(found: list[Detections], shape: tuple[int, int], config: PromptConfig) -> Detections:
    boxes = np.concatenate([one.boxes for one in found])
    scores = np.concatenate([one.scores for one in found])
    area = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    kept = (area > 0) & (area < config.largest * shape[0] * shape[1])
    return Detections(boxes[kept], scores[kept])


def _apart(found: Detections, overlap: float) -> NDArray[np.float64]:
    """Boxes (m, 4), best first, without those that an earlier one covers (greedy suppression)."""
    chosen: list[NDArray[np.float64]] = []
    for box in found.boxes[np.argsort(-found.scores, kind="stable")]:
        if all(_iou(box, other) <= overlap for other in chosen):
            chosen.append(box)
    return np.array(chosen).reshape(-1, 4)


def _iou(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    low, high = np.maximum(first[:2], second[:2]), np.minimum(first[2:], second[2:])
    shared = float(np.prod(np.maximum(high - low, 0)))
    both = float(np.prod(first[2:] - first[:2]) + np.prod(second[2:] - second[:2]))
    return shared / (both - shared)


def layered(
    masks: list[NDArray[np.bool_]], frame: Frame, seed: int, whole: SegmentConfig
) -> NDArray[np.int64]:
    """One map (H, W) of masks that may overlap, each filtered by depth.

    Pixels without depth that nothing else claims stay with their mask; flying pixels, and what
    does not hang together with the mask's largest part, go.

    Errors: FrameError if none is left.
    """
    config = whole.prompt
    on_table = _table(frame, seed, whole)
    raw = np.where(frame.valid, frame.points[..., 2], np.nan)
    flying = flying_pixels(raw, whole.smooth_depth)
    kept: list[NDArray[np.bool_]] = []
    for mask in sorted(masks, key=lambda one: -int(one.sum())):
        cleaned = _largest_piece(mask & ~flying, config.piece)
        seen = int((cleaned & frame.valid).sum())
        if seen < config.min_pixels:
            continue
        if (cleaned & on_table).sum() > config.table * seen:
            continue
        if not any(_same(cleaned, other, config.same) for other in kept):
            kept.append(cleaned)
    if not kept:
        raise FrameError(
            "The prompt found nothing that stands out of the table",
            where=frame.source,
            expected="objects that the phrase names, with depth",
            found=f"{counted(len(masks), 'mask')}, none of which is left after the depth filters",
            fix="try other words, or --segment, which needs none",
        )
    segmap = np.zeros(frame.shape, np.int64)
    columns = np.arange(frame.shape[1])
    middles = [float((mask.sum(axis=0) * columns).sum() / mask.sum()) for mask in kept]
    numbers = {int(place): n for n, place in enumerate(np.argsort(middles, kind="stable"), 1)}
    for place, mask in enumerate(kept):  # large ones first, so that small ones lie on top
        segmap[mask] = numbers[place]
    return segmap


def _same(smaller: NDArray[np.bool_], larger: NDArray[np.bool_], part: float) -> bool:
    return int((smaller & larger).sum()) > part * int(larger.sum())


def _largest_piece(mask: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    ndimage = import_library("scipy.ndimage")
    pieces, count = ndimage.label(mask, structure=np.ones((3, 3)))
    if count < 2:
        return mask
    sizes = np.bincount(pieces.ravel())
    sizes[BACKGROUND] = 0
    # Something in front may have cut it: pieces of some size stay.
    return np.asarray(mask & (sizes[pieces] >= least * sizes.max()))


def _table(frame: Frame, seed: int, config: SegmentConfig) -> NDArray[np.bool_]:
    """(H, W) pixels on the table; none where there is no table."""
    try:
        table = find_table(frame.points[frame.valid], seed, frame.source, config.table)
    except FrameError as error:
        log.info("No table was found, so that no mask is held against it: %s", error.what)
        return np.zeros(frame.shape, dtype=bool)
    with np.errstate(invalid="ignore"):
        return np.abs(table.plane.signed_distance(frame.points)) < config.prompt.height
