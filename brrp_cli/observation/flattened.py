"""Low things on a table, as a camera measures them that smooths its depth.

Active stereo matches windows and filters what it found, over steps of less than a pixel of
disparity too. So it mixes a thing of up to a few centimetres with the table around it: a knife
measures too low, and the table rises towards it. Over how many pixels it smooths is read off that
rise: what the table rises by is what the thing lacks.

Smoothing is linear in inverse depth. Where a thing makes the share w of what its pixels are mixed
of, its own inverse depth over the plane's is the measured one divided by w; that, smoothed in turn,
is by how much the table rises.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FlatteningConfig
from brrp_cli.frames.dilate import distance_to, mask_box
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.observation.support_plane import Plane

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def smoothing_width(frame: Frame, plane: Plane | None, config: FlatteningConfig) -> float:
    """Pixels, the standard deviation over which the camera mixes low things and the table: one of
    `config.widths`, or 0 where the table does not rise towards them, and where nothing is low."""
    rise, left = 0.0, np.zeros(len(config.widths))
    for thing in _low_things(frame, plane, config):
        ring = _ring(thing, config)
        if ring is not None and _towards(thing, ring) > config.least_rise:
            rise += ring.left(0.0)
            left += [ring.left(_mixed(thing, ring.level, w, config).rise) for w in config.widths]
    best = int(np.argmin(left))
    return float(config.widths[best]) if left[best] < config.most_left * rise else 0.0


def low_things(frame: Frame, plane: Plane | None, config: FlatteningConfig) -> list[int]:
    """Ids of the things that a camera may mix with the table."""
    if plane is None:
        return []
    height = plane.signed_distance(frame.points)
    return [
        i for i in frame.object_ids if _is_low(height[(frame.segmap == i) & frame.valid], config)
    ]


def raised(
    frame: Frame,
    plane: Plane | None,
    width: float,
    config: FlatteningConfig,
    only: int | None = None,
) -> Frame:
    """The frame with low things as high, and the table around them as low, as they are.

    width : pixels, of `smoothing_width`; only : the object that is raised; None = all of them
    """
    if width == 0:
        return frame
    points = frame.points.copy()
    changed = np.zeros((*frame.shape, 1))
    for thing in _low_things(frame, plane, config, only):
        ring = _ring(thing, config)
        mixed = _mixed(thing, 0.0 if ring is None else ring.level, width, config)
        # What nobody can see of this one is taken to be as of the others.
        if ring is None or ring.left(mixed.rise) < config.most_left * ring.left(0.0):
            more = np.where(thing.own, mixed.itself - thing.risen, 0.0)
            more[thing.table] = -mixed.rise[thing.table]
            changed[thing.box][..., 0] += more
    # Inverse depths add up; a point goes along its ray.
    points /= 1 + changed * points[..., 2:]
    return frame.with_points(points.astype(frame.points.dtype))


@dataclass(frozen=True)
class _LowThing:
    """A thing and what is around it. box : of the window in the image; risen : (h, w) 1 / metres,
    inverse depth over that of the plane, 0 where there is none; own, table : (h, w) its pixels and
    the table's; low, others : (h, w) pixels of other things, low ones and the rest"""

    box: tuple[slice, slice]
    risen: Array
    own: Mask
    table: Mask
    low: Mask
    others: Mask


@dataclass(frozen=True)
class _Ring:
    """What the table shows around a thing. risen : (n,) 1 / metres over `level`, which it has
    further off; around : (h, w) its n pixels"""

    risen: Array
    around: Mask
    level: float

    def left(self, rise: Array | float) -> float:
        """What is left, a sum, of the table's rise without one of (h, w)."""
        told = rise[self.around] if isinstance(rise, np.ndarray) else rise
        return float(np.abs(self.risen - told).sum())


@dataclass(frozen=True)
class _Mixed:
    """itself : (h, w) 1 / metres, the thing's own rise, 0 beside it; rise : (h, w) the table's"""

    itself: Array
    rise: Array


def _low_things(
    frame: Frame, plane: Plane | None, config: FlatteningConfig, only: int | None = None
) -> Iterator[_LowThing]:
    """The things of which `config.top` lies lower than `config.low`."""
    if plane is None:
        return
    height, low = plane.signed_distance(frame.points), low_things(frame, plane, config)
    margin = config.beside[1] + config.clear
    for object_id in low if only is None else [i for i in low if i == only]:
        box = mask_box(frame.segmap == object_id, margin)
        ids, valid = frame.segmap[box], frame.valid[box]
        inverse = np.where(valid, 1 / np.where(valid, frame.depth[box], 1.0), 0.0)
        yield _LowThing(
            box,
            np.where(valid, inverse - _inverse_of_plane(frame, plane, box), 0.0),
            (ids == object_id) & valid,
            (ids == BACKGROUND) & valid & (np.abs(np.nan_to_num(height[box])) < config.table),
            np.isin(ids, low) & (ids != object_id) & valid,
            ~np.isin(ids, [BACKGROUND, *low]),
        )


def _is_low(height: Array, config: FlatteningConfig) -> bool:
    enough = len(height) >= config.least_pixels
    return enough and bool(0 < np.quantile(height, config.top) < config.low)


def _inverse_of_plane(frame: Frame, plane: Plane, box: tuple[slice, slice]) -> Array:
    """1 / metres (h, w), inverse depth of the plane in a window of the image."""
    rows, columns = (np.arange(*each.indices(n)) for each, n in zip(box, frame.shape, strict=True))
    x = (columns - frame.K[0, 2]) / frame.K[0, 0]
    y = (rows - frame.K[1, 2]) / frame.K[1, 1]
    a, b, c = -plane.normal / plane.offset
    return np.asarray(a * x + b * y[:, None] + c)


def _ring(thing: _LowThing, config: FlatteningConfig) -> _Ring | None:
    """None where too little of the table is seen around a thing, and further off."""
    off = distance_to(thing.own)
    alone = thing.table & (distance_to(thing.low | thing.others) > config.clear)
    around = alone & (off <= config.around)
    beside = alone & (off > config.beside[0]) & (off <= config.beside[1])
    if min(np.count_nonzero(around), np.count_nonzero(beside)) < config.least_pixels:
        return None
    level = float(np.median(thing.risen[beside]))
    return _Ring(thing.risen[around] - level, around, level)


def _towards(thing: _LowThing, ring: _Ring) -> float:
    """Share of a thing's height to which the table rises around it."""
    return float(ring.risen.mean() / max(np.median(thing.risen[thing.own]) - ring.level, 1e-9))


def _mixed(thing: _LowThing, level: float, width: float, config: FlatteningConfig) -> _Mixed:
    """What the thing is, and does to the table at `level`, if the camera smooths over `width`
    pixels. What is not measured is not mixed, and what is high is not."""
    from scipy.ndimage import gaussian_filter

    low = thing.own | thing.low
    whole = np.maximum(gaussian_filter((low | thing.table).astype(np.float64), width), 1e-6)
    share = gaussian_filter(low.astype(np.float64), width) / whole
    over = (thing.risen - level) / np.clip(share, config.least_share, 1.0)
    rise = gaussian_filter(np.where(thing.own, over, 0.0), width) / whole
    return _Mixed(np.where(thing.own, over + level, 0.0), rise)
