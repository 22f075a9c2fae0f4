"""Object masks without a prior: what stands on the table, one thing apart from the other.

Depth is smoothed and freed of flying pixels. A small network that looks at colour, height, normals
and edges says which pixels show an object, and which of them the same one; what it joins becomes a
mask, whose borders then follow colour.
"""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.segmentation.bare_table import bare_pixels
from brrp_cli.segmentation.beneath import hides_its_foot
from brrp_cli.segmentation.components import absorb_small
from brrp_cli.segmentation.fill_concavities import fill_inside
from brrp_cli.segmentation.join_insides import join_insides
from brrp_cli.segmentation.left_out import CUT, IN_THE_AIR, left_out, told
from brrp_cli.segmentation.part_objects import Parted, part_objects
from brrp_cli.segmentation.reaching_in import reaching_in
from brrp_cli.segmentation.refine_borders import refine_borders
from brrp_cli.segmentation.region_growing import fill_holes, grow
from brrp_cli.segmentation.rising import rising_in
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces
from brrp_cli.segmentation.split_stacks import split_stacks
from brrp_cli.segmentation.table_plane import Table
from brrp_cli.segmentation.upright import see_upright, turned_back

log = logging.getLogger(__name__)

LEFT_OUT_ALONE = (
    "only what the image's border cuts, what seems to stand nowhere, or smears of depth,"
    " and no stored object in it"
)
REACHES_IN_ALONE = "only what reaches in over the table from outside, as an arm does"


def segment(
    frame: Frame, seed: int = 0, config: SegmentConfig | None = None, *, keep_all: bool = False
) -> NDArray[np.int64]:
    """Masks (H, W) of the objects that stand on the table: 1, 2, ... from left to right.

    keep_all : also of what the image's border cuts, and of what stands nowhere on the table
        (left_out.py)

    The frame's own masks are not looked at; background, also behind the table, is 0, and so are
    pixels without depth but for small holes inside an object.

    Errors: FrameError if there is no table or nothing stands on it.
    """
    segmap, aside = segment_and_aside(frame, seed, config, keep_all=keep_all)
    # Where all masks are left out, they come as masks, too.
    if (aside[segmap != BACKGROUND] != BACKGROUND).all():
        raise nothing_stands(frame)
    return segmap


def segment_and_aside(
    frame: Frame, seed: int = 0, config: SegmentConfig | None = None, *, keep_all: bool = False
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """What `segment` gives, and masks (H, W), 0 = none, that it leaves out. What lies on
    something else may seem to stand nowhere, what is flat and has no depth around it to be a smear,
    and of what the border cuts a stored object tells the rest. Where there is nothing else, these
    are the masks, too. mending/strangers.py leaves out again what is not recognised among them."""
    config = config or SegmentConfig()
    standing, seen, turns = see_upright(frame, seed, config)
    found = _parted(standing, seen, config, keep_all=keep_all)
    if not turns:
        return found
    segmap, aside = (turned_back(each, turns) for each in found)
    return _numbered(segmap, frame, config), aside


def _parted(
    frame: Frame, seen: SeenSurfaces, config: SegmentConfig, *, keep_all: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The same of a frame that is upright."""
    points, table = seen.points, seen.table
    area = _areas(frame)
    rises = rising_in(frame, seen, config)
    parted = part_objects(frame, seen, rises.risen, config)
    away = reaching_in(frame, seen, rises.lift, config)
    labels, reaching = _parted_from(parted.labels, away)
    rises = rises.without(away)
    objects = join_insides(labels, seen.plan, seen.height, table.plan(seen.normals), config.insides)
    objects = split_stacks(objects, frame.rgb, seen.height, config.stacks)
    segmap = absorb_small(objects, parted.border, ~_are_large(objects, area, parted, config))
    # Pixels at edges, which were left out of the smoothed depth, join what they lie next to.
    edges = frame.valid & ~seen.valid
    edges &= _may_rise(frame, table, rises.lift, config) & ~away
    points = np.where(edges[..., None], frame.points, points)
    segmap = grow(segmap, points, rises.rim | edges, config.reach)
    # Specks would grow with their borders.
    segmap = _large(segmap, area, parted, config)
    # What the network takes for table stays table, whatever stands around it.
    floors = rises.floor & (parted.object > config.concavities.object)
    filled = fill_inside(segmap, table.plan(points), floors, config.concavities)
    changed, known = filled != segmap, int(filled.max())
    # Back to where it is: a border with it is none with the table.
    filled = np.where((filled == BACKGROUND) & (reaching > 0), reaching + known, filled)
    segmap = refine_borders(filled, frame.rgb, changed, config.borders)
    segmap = _large(fill_holes(segmap, ~frame.valid), area, parted, config)
    aside = np.zeros_like(segmap)
    if not keep_all:
        segmap, aside = _without(segmap, known, frame, table, config)
        if away.any() and not (segmap.any() or aside.any()):
            raise nothing_stands(frame, REACHES_IN_ALONE)
    return _numbered(segmap if segmap.any() else aside, frame, config), aside


def nothing_stands(frame: Frame, found: str = LEFT_OUT_ALONE) -> FrameError:
    """The error where no mask is left; found : what there is instead."""
    return FrameError(
        "Nothing stands on the table",
        where=frame.source,
        expected="objects that rise above their support plane",
        found=found,
        fix="check the unit of depth (--depth-scale), move the camera nearer, keep what the image's"
        " border cuts (--all), or pass masks with --masks",
    )


def _parted_from(
    labels: NDArray[np.int64], away: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Labels (H, W) without pixels that are `away` (H, W), and those of which most is."""
    count = np.bincount(labels.ravel())
    mostly = 2 * np.bincount(labels[away], minlength=len(count)) > count
    mostly[BACKGROUND] = False
    theirs = mostly[labels]
    return np.where(theirs | away, BACKGROUND, labels), np.where(theirs, labels, BACKGROUND)


def _may_rise(
    frame: Frame, table: Table, lift: NDArray[np.float64], config: SegmentConfig
) -> NDArray[np.bool_]:
    """(H, W) the pixels whose own depth rises nearly as far as an object's must, `lift` (H, W)."""
    height = table.height(frame.points)
    may = height > config.rim * lift
    may[may] = ~table.bin_walls(table.plan(frame.points[may]), height[may], config.bins)
    return may


def _without(
    segmap: NDArray[np.int64], known: int, frame: Frame, table: Table, config: SegmentConfig
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The masks without those that are left out, which the log tells, and of the latter those that
    a stored object may explain. Masks over `known` reach in through the air: links of an arm often
    look like stored objects."""
    points = np.where(frame.valid[..., None], frame.points, np.nan)
    height = table.height(points)
    over, masked = np.zeros(frame.shape, dtype=bool), (segmap > 0) & frame.valid
    over[masked] = table.holds(table.plan(points[masked]), 0.0)
    bare = bare_pixels(frame, segmap, height, table, config.table)
    # What hides its own foot, as from above, is not seen to hang.
    found = left_out(segmap, points[..., 2], height, over, bare, config.left_out)
    reasons = {
        i: reason
        for i, reason in found.items()
        if i <= known
        and (
            reason != IN_THE_AIR
            or not hides_its_foot(segmap == i, frame, table.plane, over, config.left_out)
        )
    }
    if reasons:
        log.info("Masks left out, unless recognised: %s (--all keeps them)", told(reasons))
    arms = np.unique(segmap[segmap > known]).tolist()
    if arms:
        log.info("Masks left out, of what reaches in as arms do: %d (--all keeps them)", len(arms))
    out = np.isin(segmap, [*reasons, *arms])
    # Of what shows a corner of itself alone, many stored objects could tell the rest.
    shown = np.bincount(segmap[frame.valid], minlength=int(segmap.max()) + 1)
    corners = [i for i, why in reasons.items() if why == CUT and shown[i] < config.left_out.tell]
    return (
        np.where(out, BACKGROUND, segmap),
        np.where(out & ~np.isin(segmap, [*corners, *arms]), segmap, BACKGROUND),
    )


def _areas(frame: Frame) -> NDArray[np.float64]:
    """(H, W) what each pixel shows, metres squared, as if seen face on; 0 without depth."""
    focal = frame.K[0, 0] * frame.K[1, 1]
    return np.asarray(np.nan_to_num(frame.points[..., 2] ** 2) / focal, dtype=np.float64)


def _sure(segmap: NDArray[np.int64], parted: Parted, config: SegmentConfig) -> NDArray[np.bool_]:
    """(n + 1,) whether the network takes each label for an object with little doubt."""
    sums = np.bincount(segmap.ravel(), parted.object.ravel())
    return np.asarray(sums > config.sure * np.bincount(segmap.ravel()))


def _are_large(
    segmap: NDArray[np.int64], area: NDArray[np.float64], parted: Parted, config: SegmentConfig
) -> NDArray[np.bool_]:
    """(n + 1,) whether each label shows so much of itself that it is no speck."""
    least = config.min_area * np.where(_sure(segmap, parted, config), config.sure_part, 1.0)
    return np.asarray(np.bincount(segmap.ravel(), area.ravel()) >= least)


def _large(
    segmap: NDArray[np.int64], area: NDArray[np.float64], parted: Parted, config: SegmentConfig
) -> NDArray[np.int64]:
    """The masks that are no specks."""
    large = _are_large(segmap, area, parted, config)
    return np.where(large[segmap], segmap, BACKGROUND)


def _numbered(segmap: NDArray[np.int64], frame: Frame, config: SegmentConfig) -> NDArray[np.int64]:
    """The masks numbered by the column of their middle. Errors: FrameError without any."""
    rows, columns = np.nonzero(segmap)
    labels = segmap[rows, columns]
    pixels = np.bincount(labels)
    there = np.flatnonzero(pixels)
    if not len(there):
        raise nothing_stands(frame, f"none that shows {config.min_area * 1e4:g} cm^2 of itself")
    middles = np.bincount(labels, columns)[there] / pixels[there]
    numbers = np.zeros_like(pixels)
    numbers[there[np.argsort(middles, kind="stable")]] = np.arange(1, len(there) + 1)
    return np.asarray(numbers[segmap], dtype=np.int64)
