"""Masks mended by what was recognised: a placed model says which pixels are its own.

A recognised object takes over masks that its placed model explains, and gives back the pixels of
its own mask that it does not explain. All of it is told from rendered depth, mask by mask.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.mending import MendConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.dilate import dilated, opened
from brrp_cli.frames.frame import BACKGROUND

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Placed:
    """A recognised object where it was placed.

    object_id : of its mask; weight : of the placement in the posterior, 0 to 1
    depth : (H, W) metres, as it alone would be seen; 0 where it would not be
    """

    object_id: int
    weight: float
    depth: NDArray[np.floating]


@dataclass(frozen=True)
class Mended:
    """Masks (H, W), and the ids of those that are not what they were; ids that are gone are not
    among them."""

    segmap: NDArray[np.int64]
    changed: tuple[int, ...]


def mend_masks(
    segmap: NDArray[np.int64],
    depth: NDArray[np.floating],
    placed: Sequence[Placed],
    height: NDArray[np.floating] | None,
    tolerance: NDArray[np.floating],
    config: MendConfig,
    first_free: int = 1,
    fixed: Collection[int] = (),
) -> Mended:
    """The masks after each placed object claimed what it explains and gave back what it does not.

    A pixel is explained by an object whose rendered depth there is the measured one within the
    tolerance. Objects that weigh less than `config.least_weight`, or that explain too little of
    their own masks, change nothing.

    segmap : (H, W), 0 = background; depth : (H, W) metres, NaN = no return
    height : (H, W) metres above the support plane, None where there is none: what is given back and
    lies on it is background
    tolerance : (H, W) metres; first_free : what becomes an object of its own has this id at least
    fixed : ids of masks that nothing takes over
    """
    found = segmap.copy()
    seen = np.isfinite(depth) & (depth > 0)
    explained = {p.object_id: explained_pixels(p.depth, depth, tolerance) for p in placed}
    trusted = sorted(
        (p for p in placed if _trusted(p, segmap, seen, explained[p.object_id], config)),
        key=lambda p: (-p.weight, -int(explained[p.object_id].sum())),
    )
    strongest = {p.object_id: p.weight for p in trusted}
    for p in trusted:
        if not (found == p.object_id).any():  # another one took it over
            continue
        _claim(found, p, seen, explained[p.object_id], strongest, fixed, config)
    for p in trusted:
        if (found == p.object_id).any():
            _give_back(found, p, seen, explained, height, tolerance, depth, first_free, config)
    changed = changed_masks(found, segmap, config.least_part)
    gone = np.setdiff1d(segmap, found)
    if not changed and not len(gone):
        return Mended(segmap, ())
    return Mended(found, tuple(changed))


def changed_masks(
    now: NDArray[np.int64], before: NDArray[np.int64], least_part: float
) -> list[int]:
    """Ids of those masks (H, W) that differ from those before by more than that part of them."""

    def differs(one: Mask, other: Mask) -> bool:
        return bool((one ^ other).sum() > least_part * other.sum())

    return [int(i) for i in np.unique(now[now != BACKGROUND]) if differs(now == i, before == i)]


def explained_pixels(
    rendered: NDArray[np.floating], depth: NDArray[np.floating], tolerance: NDArray[np.floating]
) -> Mask:
    """Pixels (H, W) whose measured depth an object explains, which has the depth `rendered` there,
    0 where it would not be seen. depth : NaN = no return; all (H, W), metres"""
    with np.errstate(invalid="ignore"):
        return np.asarray((rendered > 0) & (np.abs(rendered - depth) < tolerance))


def _trusted(
    p: Placed, segmap: NDArray[np.int64], seen: Mask, explained: Mask, config: MendConfig
) -> bool:
    own = (segmap == p.object_id) & seen
    enough = explained[own].sum() >= config.own * max(int(own.sum()), 1)
    return bool(p.weight >= config.least_weight and own.any() and enough)


def _claim(
    found: NDArray[np.int64],
    p: Placed,
    seen: Mask,
    explained: Mask,
    weights: dict[int, float],
    fixed: Collection[int],
    config: MendConfig,
) -> None:
    """Masks that lie within the object as it was placed become part of it."""
    for other in np.unique(found[explained & (found != p.object_id) & (found != BACKGROUND)]):
        mask = (found == other) & seen
        if other in fixed or explained[mask].sum() < config.claimed * mask.sum():
            continue
        # A recognised object yields to one that explains more of the image with it.
        if int(other) in weights and weights[int(other)] > p.weight:
            continue
        found[found == other] = p.object_id


def _give_back(
    found: NDArray[np.int64],
    p: Placed,
    seen: Mask,
    explained: dict[int, Mask],
    height: NDArray[np.floating] | None,
    tolerance: NDArray[np.floating],
    depth: NDArray[np.floating],
    first_free: int,
    config: MendConfig,
) -> None:
    """Compact groups of pixels that the object cannot have become objects of their own, or
    another's that explains them, or background where they lie on the table."""
    mask = found == p.object_id
    # The silhouette of a placement that is right is a pixel or two beside the mask's.
    near = dilated(p.depth > 0, config.silhouette)
    with np.errstate(invalid="ignore"):
        off = np.abs(p.depth - depth) > config.sure * tolerance
    strange = mask & seen & np.where(p.depth > 0, off, ~near)
    core = opened(strange, config.opening)
    if not core.any():
        return
    # What is next to a group and not the object's either is the group's: also the silhouette's
    # neighbours, which would part a thing that stands on another in two.
    around = dilated(core, config.opening + config.silhouette)
    ndimage = import_library("scipy.ndimage")
    groups, count = ndimage.label(around & mask & seen & ~explained[p.object_id])
    least = max(config.least_pixels, config.least_part * int((mask & seen).sum()))
    for group in range(1, count + 1):
        pixels = groups == group
        if pixels.sum() < least:
            continue
        others = {
            i: int(one[pixels].sum())
            for i, one in explained.items()
            if i != p.object_id and (found == i).any()
        }
        best = max(others, key=lambda i: others[i], default=None)
        if best is not None and others[best] >= config.claimed * pixels.sum():
            found[pixels] = best
        elif height is not None and float(np.nanmedian(height[pixels])) < config.table:
            found[pixels] = BACKGROUND
        else:
            found[pixels] = max(int(found.max()) + 1, first_free)
