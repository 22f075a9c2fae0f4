"""What is known at a point from where it lies to the seen part of an object: a few features.

No length says by itself whether a point is inside. Together they do, and the same way for all kinds
of objects: a point as far behind the seen surface as that is from the silhouette, say, is mostly
inside. network.py weighs them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brrp_cli.completion.convex_hull import outside_hull
from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.frames.frame import BACKGROUND
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.geometry import transform_points

Array = NDArray[np.float64]
Features = NDArray[np.float32]

# Lengths, of which the last are the object's own, the same at all points.
COUNT, WHOLE = 52, 6


def point_features(points: Array, part: VisiblePart) -> Features:
    """(n, `COUNT`) of points (n, 3), metres, camera frame. Lengths stand in tenths of `far` and in
    the object's sizes; without a plane, heights count as in the middle of the object."""
    frame, size, config = part.frame, part.size, part.config
    far, ratio, thin = config.far, config.ratio, config.thin
    behind = np.clip(np.nan_to_num(-depth_behind(points, frame)), -far, far)
    label = at_pixels(points, frame.segmap, frame)
    own = label == part.object_id
    ground = label == BACKGROUND
    # From pixels to metres at the point's own depth.
    pixel = np.maximum(points[:, 2], 0) / frame.K[0, 0]
    silhouette = np.nan_to_num(at_pixels(points, part.silhouette, frame)) * pixel
    local_thickness = np.nan_to_num(at_pixels(points, part.limbs, frame)) * pixel

    outside = outside_hull(points, part.facets)
    away, nearest = cKDTree(part.seen).query(points)
    if part.plane is None or part.height_map is None:
        height = np.full(len(points), part.top)
        over_map = np.full(len(points), -part.top)
        beside = away
        lower = np.zeros(len(points))
    else:
        height = part.plane.signed_distance(points)
        over_map = part.height_map.above(points)
        T = part.height_map.T_plane_cam
        beside, _ = cKDTree(transform_points(T, part.seen)[:, :2]).query(
            transform_points(T, points)[:, :2]
        )
        lower = (part.seen[nearest] - points) @ part.plane.normal
    # As if what is seen were the front of something round.
    across = points @ part.across - part.middle
    ahead = points @ part.ahead - part.front
    length = part.back - part.front
    center = max(part.width, length) / 2
    round_ = np.hypot(across, ahead - center)
    along = ((points - part.seen[nearest]) * part.normals[nearest]).sum(axis=1)
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
    ]
    # Most things are the same from behind, or left and right.
    mirrored = [
        *_mirrored(points, 2 * (ahead - center), part.ahead, part),
        *_mirrored(points, 2 * (ahead - length / 2), part.ahead, part),
        *_mirrored(points, 2 * across, part.across, part),
    ]
    whole = [
        size / far,
        part.top / size,
        part.width / size,
        length / size,
        part.depths.mean() / size,
        np.quantile(part.depths, config.most[1]) / size,
    ]
    columns = [np.clip(one / size, -ratio, ratio) for one in each + mirrored]
    columns += [np.clip(one, -far, far) / (far / 10) for one in each]
    columns += [
        own,
        ground,
        np.clip(behind / (silhouette + thin), -ratio, ratio),
        np.clip(height / max(part.top, config.least), -1, ratio),
        np.clip(round_ / center, 0, ratio),
        np.clip(behind / (local_thickness + thin), -ratio, ratio),
        part.normals[nearest] @ part.ahead,
        np.abs(part.normals[nearest] @ part.across),
        part.normals[nearest] @ part.up,
    ]
    columns += [np.full(len(points), one) for one in whole]
    return np.stack(columns, axis=1).astype(np.float32)


def _mirrored(points: Array, twice: Array, direction: Array, part: VisiblePart) -> list[Array]:
    """Where each point's image lies, `twice` its distance from the mirror back along the unit
    `direction`: behind what is seen, within the silhouette, over the height_map."""
    far = part.config.far
    image = points - twice[:, None] * direction
    behind = np.clip(np.nan_to_num(-depth_behind(image, part.frame)), -far, far)
    silhouette = np.nan_to_num(at_pixels(image, part.silhouette, part.frame))
    over = (
        np.full(len(points), -part.top) if part.height_map is None else part.height_map.above(image)
    )
    return [behind, silhouette * np.maximum(image[:, 2], 0) / part.frame.K[0, 0], over]
