"""What is known at a point from where it lies to the seen part of an object: a few features.

No length says by itself whether a point is inside. Together they do, and the same way for all kinds
of objects: a point as far behind the seen surface as that is from the silhouette, say, is mostly
inside. network.py weighs them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.completion.convex_hull import outside_hull
from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.frames.frame import BACKGROUND
from brrp_cli.frames.projection import pixel_numbers
from brrp_cli.geometry import transform_points

Array = NDArray[np.float64]
Floats = NDArray[np.floating]
Features = NDArray[np.float32]

# Features of a point, of which the last are the object's own, the same at all points.
COUNT, WHOLE = 72, 9
# The label of what lies outside of the image.
NOWHERE = np.iinfo(np.int64).min


def point_features(points: Array, part: VisiblePart) -> Features:
    """(n, `COUNT`) of points (n, 3), metres, camera frame, feature by feature in memory. Lengths
    stand in tenths of `far` and in the object's sizes; without a plane, heights count as in the
    middle of the object."""
    size, far, ratio = part.size, part.config.far, part.config.ratio
    at = _located(points, part)
    lengths = _lengths(at, part)
    found = np.empty((COUNT, len(points)), np.float32)
    row = 0
    for one in lengths + _mirrored(at, part):
        np.clip(one / size, -ratio, ratio, out=found[row], casting="same_kind")
        row += 1
    for one in lengths:
        np.divide(np.clip(one, -far, far), far / 10, out=found[row], casting="same_kind")
        row += 1
    for number in _ratios(at, part):
        found[row] = number
        row += 1
    found[row:] = np.array(_of_the_whole(part))[:, None]
    return found.T


@dataclass(frozen=True)
class _Located:
    """Where points (n, 3) lie, in the image and to the seen part.

    label : (n,) of the pixel; behind, silhouette, thickness : (n,) metres, of its depth and of
    silhouette.py; away, nearest : (n,) metres to the nearest seen point, and which that is; normal
    : (n, 3) there; height : (n,) metres over the plane; flat : (n, 2) metres along `across` and
    `ahead`; across, ahead : (n,) of these, from the middle and from the front; round_ : (n,) metres
    from the axis, as if what is seen were the front of something round
    """

    points: Array
    label: NDArray[np.int64]
    behind: Array
    silhouette: Floats
    thickness: Floats
    away: Array
    nearest: NDArray[np.int64]
    normal: Array
    height: Array
    flat: Array
    across: Array
    ahead: Array
    round_: Array


def _located(points: Array, part: VisiblePart) -> _Located:
    frame = part.frame
    pixel, visible = pixel_numbers(points, frame)
    # From pixels to metres at the point's own depth.
    metres = np.where(visible, points[:, 2] / frame.K[0, 0], 0.0)
    away, nearest = part.tree.query(points)
    height = np.full(len(points), part.top)
    if part.plane is not None and part.height_map is not None:
        height = part.plane.signed_distance(points)
    flat = np.stack([points @ part.across, points @ part.ahead], axis=1)
    across, ahead = flat[:, 0] - part.middle, flat[:, 1] - part.front
    return _Located(
        points,
        label=np.where(visible, frame.segmap.ravel()[pixel], NOWHERE),
        behind=_behind(points, pixel, visible, part),
        silhouette=part.silhouette.ravel()[pixel] * metres,
        thickness=part.thickness.ravel()[pixel] * metres,
        away=away,
        nearest=nearest,
        normal=part.normals[nearest],
        height=height,
        flat=flat,
        across=across,
        ahead=ahead,
        round_=np.hypot(across, ahead - part.center),
    )


def _lengths(at: _Located, part: VisiblePart) -> list[Floats]:
    """From the points to what is seen, (n,) each, metres."""
    points, seen = at.points, part.seen[at.nearest]
    upright = points @ part.up
    if part.plane is None or part.height_map is None:
        over_map, beside, lower = np.full(len(points), -part.top), at.away, np.zeros(len(points))
    else:
        over_map = part.height_map.above(points)
        T = part.height_map.T_plane_cam
        beside, _ = part.tree_on_plane.query(transform_points(T, points)[:, :2])
        lower = seen @ part.up - upright
    outer, inner = part.profile.radii(upright)
    beside_seen = [_free_beside(points + step * part.size, part) for step in _steps(part)]
    return [
        outside_hull(points, part.facets),
        at.away,
        beside,
        at.behind,
        at.silhouette,
        at.height,
        over_map,
        lower,
        part.depths[at.nearest],
        np.abs(at.across),
        at.ahead,
        at.round_,
        at.thickness,
        ((points - seen) * at.normal).sum(axis=1),
        at.round_ - outer,
        at.round_ - inner,
        part.rectangle.outside(at.flat),
        beside_seen[0],
        beside_seen[1],
        np.maximum(*beside_seen[2:]),
        np.minimum(*beside_seen[2:]),
    ]


def _mirrored(at: _Located, part: VisiblePart) -> list[Floats]:
    """Lengths (n,), metres, of the points' images. Most things are the same from behind, or left
    and right; boxes, from the other corner."""
    points, middle = at.points, (part.back - part.front) / 2
    turn = 2 * (at.flat - part.rectangle.centre)
    return [
        *_image(points - 2 * (at.ahead - part.center)[:, None] * part.ahead, part),
        *_image(points - 2 * (at.ahead - middle)[:, None] * part.ahead, part),
        *_image(points - 2 * at.across[:, None] * part.across, part),
        *_image(points - turn @ np.stack([part.across, part.ahead]), part),
    ]


def _ratios(at: _Located, part: VisiblePart) -> list[NDArray[np.floating | np.bool_]]:
    """What is no length at the points, (n,) each."""
    ratio, thin = part.config.ratio, part.config.thin
    return [
        at.label == part.object_id,
        at.label == BACKGROUND,
        np.clip(at.behind / (at.silhouette + thin), -ratio, ratio),
        np.clip(at.height / max(part.top, part.config.least), -1, ratio),
        np.clip(at.round_ / part.center, 0, ratio),
        np.clip(at.behind / (at.thickness + thin), -ratio, ratio),
        at.normal @ part.ahead,
        np.abs(at.normal @ part.across),
        at.normal @ part.up,
    ]


def _of_the_whole(part: VisiblePart) -> list[float]:
    """The `WHOLE` features that are the object's own."""
    size = part.size
    return [
        size / part.config.far,
        part.top / size,
        part.width / size,
        (part.back - part.front) / size,
        part.depths.mean() / size,
        np.quantile(part.depths, part.config.most[1]) / size,
        *(2 * part.rectangle.half / size),
        part.free,
    ]


def _steps(part: VisiblePart) -> list[NDArray[np.floating]]:
    """Where, in the object's sizes, one looks whether free space is seen beside a point."""
    higher, aside = part.config.higher, part.config.aside
    return [higher * part.up, (higher / 3) * part.up, aside * part.across, -aside * part.across]


def _free_beside(points: Array, part: VisiblePart) -> Array:
    return _behind(points, *pixel_numbers(points, part.frame), part)


def _behind(
    points: Array, pixel: NDArray[np.int64], visible: NDArray[np.bool_], part: VisiblePart
) -> Array:
    """How far (n,) points (n, 3) lie behind the measured depth, metres; 0 where there is none."""
    measured = part.frame.depth.ravel()[pixel]
    behind = np.where(visible, points[:, 2] - measured, 0.0)
    behind[np.isnan(behind)] = 0.0
    return np.clip(behind, -part.config.far, part.config.far, out=behind)


def _image(image: Array, part: VisiblePart) -> list[Floats]:
    """Where the image (n, 3) of each point lies: behind what is seen, within the silhouette, over
    the height map."""
    pixel, visible = pixel_numbers(image, part.frame)
    behind = _behind(image, pixel, visible, part)
    metres = np.where(visible, image[:, 2] / part.frame.K[0, 0], 0.0)
    over = (
        np.full(len(image), -part.top) if part.height_map is None else part.height_map.above(image)
    )
    within = part.silhouette.ravel()[pixel] * metres
    return [behind, within, over]
