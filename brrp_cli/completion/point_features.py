"""What is known at a point from where it lies to the seen part of an object: a few features.

No length says by itself whether a point is inside. Together they do, and the same way for all kinds
of objects: a point as far behind the seen surface as that is from the silhouette, say, is mostly
inside. network.py weighs them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.completion.convex_hull import outside_hull
from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.frames.frame import BACKGROUND
from brrp_cli.frames.projection import pixel_numbers
from brrp_cli.geometry import transform_points

Array = NDArray[np.float64]
Features = NDArray[np.float32]

# Lengths, of which the last are the object's own, the same at all points.
COUNT, WHOLE = 72, 9
# The label of what lies outside of the image.
NOWHERE = np.iinfo(np.int64).min


def point_features(points: Array, part: VisiblePart) -> Features:
    """(n, `COUNT`) of points (n, 3), metres, camera frame, feature by feature in memory. Lengths
    stand in tenths of `far` and in the object's sizes; without a plane, heights count as in the
    middle of the object."""
    frame, size, config = part.frame, part.size, part.config
    far, ratio, thin = config.far, config.ratio, config.thin
    pixel, visible = pixel_numbers(points, frame)
    label = np.where(visible, frame.segmap.ravel()[pixel], NOWHERE)
    behind = _behind(points, pixel, visible, part)
    # From pixels to metres at the point's own depth.
    metres = np.where(visible, points[:, 2] / frame.K[0, 0], 0.0)
    silhouette = part.silhouette.ravel()[pixel] * metres
    local_thickness = part.thickness.ravel()[pixel] * metres

    outside = outside_hull(points, part.facets)
    away, nearest = part.tree.query(points)
    normal = part.normals[nearest]
    upright = points @ part.up
    if part.plane is None or part.height_map is None:
        height = np.full(len(points), part.top)
        over_map = np.full(len(points), -part.top)
        beside = away
        lower = np.zeros(len(points))
    else:
        height = part.plane.signed_distance(points)
        over_map = part.height_map.above(points)
        T = part.height_map.T_plane_cam
        beside, _ = part.tree_on_plane.query(transform_points(T, points)[:, :2])
        lower = part.seen[nearest] @ part.up - upright
    # As if what is seen were the front of something round.
    flat = np.stack([points @ part.across, points @ part.ahead], axis=1)
    across, ahead = flat[:, 0] - part.middle, flat[:, 1] - part.front
    length, center = part.back - part.front, part.center
    round_ = np.hypot(across, ahead - center)
    outer, inner = part.profile.radii(upright)
    along = ((points - part.seen[nearest]) * normal).sum(axis=1)
    beside_seen = [_free_beside(points + step * size, part) for step in _steps(part)]
    each = [
        outside,
        away,
        beside,
        behind,
        silhouette,
        height,
        over_map,
        lower,
        part.depths[nearest],
        np.abs(across),
        ahead,
        round_,
        local_thickness,
        along,
        round_ - outer,
        round_ - inner,
        part.rectangle.outside(flat),
        beside_seen[0],
        beside_seen[1],
        np.maximum(*beside_seen[2:]),
        np.minimum(*beside_seen[2:]),
    ]
    # Most things are the same from behind, or left and right; boxes, from the other corner.
    turn = 2 * (flat - part.rectangle.centre)
    mirrored = [
        *_image(points - 2 * (ahead - center)[:, None] * part.ahead, part),
        *_image(points - 2 * (ahead - length / 2)[:, None] * part.ahead, part),
        *_image(points - 2 * across[:, None] * part.across, part),
        *_image(points - turn @ np.stack([part.across, part.ahead]), part),
    ]
    whole = [
        size / far,
        part.top / size,
        part.width / size,
        length / size,
        part.depths.mean() / size,
        np.quantile(part.depths, config.most[1]) / size,
        *(2 * part.rectangle.half / size),
        part.free,
    ]
    found = np.empty((COUNT, len(points)), np.float32)
    row = 0
    for one in each + mirrored:
        np.clip(one / size, -ratio, ratio, out=found[row], casting="same_kind")
        row += 1
    for one in each:
        np.divide(np.clip(one, -far, far), far / 10, out=found[row], casting="same_kind")
        row += 1
    for one in (
        label == part.object_id,
        label == BACKGROUND,
        np.clip(behind / (silhouette + thin), -ratio, ratio),
        np.clip(height / max(part.top, config.least), -1, ratio),
        np.clip(round_ / center, 0, ratio),
        np.clip(behind / (local_thickness + thin), -ratio, ratio),
        normal @ part.ahead,
        np.abs(normal @ part.across),
        normal @ part.up,
        *whole,
    ):
        found[row] = one
        row += 1
    return found.T


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


def _image(image: Array, part: VisiblePart) -> list[NDArray[np.floating]]:
    """Where the image (n, 3) of each point lies: behind what is seen, within the silhouette, over
    the height_map."""
    pixel, visible = pixel_numbers(image, part.frame)
    behind = _behind(image, pixel, visible, part)
    metres = np.where(visible, image[:, 2] / part.frame.K[0, 0], 0.0)
    over = (
        np.full(len(image), -part.top) if part.height_map is None else part.height_map.above(image)
    )
    within = part.silhouette.ravel()[pixel] * metres
    return [behind, within, over]
