"""Other masks, tried: in which of them is a stored object, and which pixels does it explain?

An object that was found in a piece of itself tells where the rest of it is: what it explains of all
masks that may be regrouped is tried as one mask, too. Only of one that was recognised with little
doubt: a mask that was made of what an object explains is always well explained by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.mending.again import Again
from brrp_cli.mending.explain import explained
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.segmentation.other_masks import OtherMask

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Found:
    """A mask in which a stored object is recognised with so much weight, and the pixels (H, W) of
    the image that it explains as it was placed."""

    mask: OtherMask
    weight: float
    explains: Mask

    @property
    def pixels(self) -> int:
        """How much of the mask it explains."""
        return int((self.explains & self.mask.mask).sum())


@dataclass(frozen=True)
class Tries:
    """Tries masks of one frame.

    result : what is known of the frame; again : which looks at other masks of it
    """

    result: Reconstruction
    prior: Prior
    again: Again
    config: SegmentConfig

    def found(self, masks: Sequence[OtherMask]) -> list[Found]:
        """Those of the masks in which a stored object is recognised."""
        if not masks:
            return []
        frame, trial = self.result.frame, self.config.regroup.trial
        tried = self.again.masks(
            frame, [each.mask for each in masks], trial, image=self.result.image
        )
        return [
            Found(
                mask,
                float(item.recognised.weight or 0.0),
                explained(item.recognised, self.prior, frame, self.config.mend),
            )
            for mask, item in zip(masks, tried, strict=True)
            if item.recognised is not None
        ]

    def fits(self, each: Found) -> bool:
        """Whether the object explains most of its mask, and not much of others."""
        frame, own = self.result.frame, self.config.regroup
        seen = int((each.mask.mask & frame.valid).sum())
        # The print on a can looks like a smaller can, which would hide more of the can than that.
        everywhere = each.explains & (each.mask.mask | (frame.segmap != BACKGROUND))
        return each.pixels >= max(own.explained * seen, own.within * int(everywhere.sum()))

    def sure(self, each: Found) -> bool:
        """Whether the object is beyond doubt there."""
        own, doubted = self.config.regroup, each.mask.cut or each.mask.known
        sure = each.weight >= (own.sure if doubted else own.whole)
        return sure and (not each.mask.known or self._explains_all(each))

    def _explains_all(self, each: Found) -> bool:
        """Whether the object explains most of what is tried of every mask: one that is recognised
        takes in nothing that is not its own."""
        frame, least = self.result.frame, self.config.regroup.explained
        seen = each.mask.mask & frame.valid
        parts = (seen & (frame.segmap == i) for i in each.mask.of)
        return all((each.explains & part).sum() >= least * part.sum() for part in parts)

    def known(self, objects: Sequence[ObjectReconstruction]) -> list[Found]:
        """Those of the frame's objects that are recognised, in the masks that they have."""
        frame, least = self.result.frame, self.config.regroup.least_weight
        return [
            Found(
                OtherMask(frame.segmap == each.object_id, frozenset([each.object_id])),
                float(placed.weight or 0.0),
                explained(placed, self.prior, frame, self.config.mend),
            )
            for each in objects
            if (placed := each.recognised) is not None
            and placed.T_cam_object is not None
            and (placed.weight or 0.0) >= least
        ]

    def grown(
        self, found: Sequence[Found], tried: Sequence[OtherMask], free: Mask
    ) -> list[OtherMask]:
        """Masks of what objects of little doubt explain of the pixels `free` (H, W) and of their
        own mask, the least in doubt first, but for those that are nearly one that was tried."""
        frame, own = self.result.frame, self.config.regroup
        more: list[OtherMask] = []
        for each in sorted(found, key=lambda each: -each.weight):
            if each.weight < own.whole or len(more) == own.grown:
                break
            if each.mask.known and not self.sure(each):
                continue
            mask = _grown(each, free, frame, own.closing, own.least_share)
            pixels = mask.mask.sum()
            same = any(
                (mask.mask ^ other.mask).sum() < own.same * pixels
                for other in [each.mask, *tried, *more]
            )
            if (mask.mask & frame.valid).sum() >= own.least_pixels and not same:
                more.append(mask)
        return more


def _grown(each: Found, free: Mask, frame: Frame, closing: int, least: float) -> OtherMask:
    """What is explained, its gaps closed, without the masks of which it holds next to nothing."""
    ndimage = import_library("scipy.ndimage")
    free = free | each.mask.mask
    mask = ndimage.binary_closing(each.explains & free, iterations=closing) & free
    if not each.mask.cut:
        mask |= each.mask.mask
    ids, counts = np.unique(frame.segmap[mask], return_counts=True)
    held = ids[(ids == BACKGROUND) | (counts > least * mask.sum())]
    of = frozenset(int(i) for i in held if i != BACKGROUND)
    return OtherMask(mask & np.isin(frame.segmap, held), of, cut=True, known=each.mask.known & of)
