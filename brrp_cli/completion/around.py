"""What is known at a point from where it lies to the seen part of an object: a few lengths.

No length says by itself whether a point is inside. Together they do, and the same way for all kinds
of objects: a point as far behind the seen surface as that is from the outline, say, is mostly
inside. network.py weighs them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from brrp_cli.completion.hull import hull_facets
from brrp_cli.completion.roof import Roof, roof_over
from brrp_cli.config import CompletionConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.lookup import at_pixels, depth_behind
from brrp_cli.frames.plane import Plane
from brrp_cli.frames.subsample import grid_subsample
from brrp_cli.geometry import normalise, transform_points

Array = NDArray[np.float64]
Features = NDArray[np.float32]

# Lengths beyond these tell nothing more, metres; ratios of lengths likewise.
FAR = 0.2
RATIO = 4.0
# Metres; smaller extents are as noisy as depth is.
LEAST = 0.005
# Shares of the seen points between which an object's size is taken: strays do not count.
MOST = (0.02, 0.98)
CHUNK = 512


@dataclass(frozen=True)
class SeenPart:
    """One object as far as a frame shows it; metres, camera frame.

    seen : (n, 3) observed points, thinned; feet : (m, 3) theirs on the plane, none without one
    facets : (f, 4) of the hull of both, outward unit normal and offset; roof : None without a plane
    size : diagonal of the box of the seen points; top : the height of the highest over the plane
    ahead, across : (3,) unit directions along the plane, away from the camera and across; front,
    back : where the seen points begin and end ahead; middle, width : of them across
    depths : (n,) how deep the seen points lie in the hull: much of a cup's inside does
    """

    frame: Frame
    object_id: int
    plane: Plane | None
    seen: Array
    feet: Array
    facets: Array
    roof: Roof | None
    size: float
    top: float
    ahead: Array
    across: Array
    front: float
    back: float
    middle: float
    width: float
    depths: Array

    @property
    def extent(self) -> Array:
        """(n + m, 3) points that span what is likely to be the object."""
        return np.concatenate([self.seen, self.feet])


def seen_part(
    points: NDArray[np.floating],
    frame: Frame,
    object_id: int,
    plane: Plane | None,
    config: CompletionConfig,
) -> SeenPart:
    """From an object's observed points (n, 3), metres, camera frame, and its support plane."""
    seen = grid_subsample(points, config.cell).astype(np.float64)
    low, high = np.quantile(seen, MOST, axis=0)
    size = max(float(np.linalg.norm(high - low)), LEAST)
    if plane is None:
        # Upright in the image is as good a guess as any.
        up = np.array([0.0, -1.0, 0.0])
        feet, roof, top = np.zeros((0, 3)), None, size / 2
    else:
        up = plane.normal
        height = np.maximum(plane.signed_distance(seen), 0.0)
        feet = seen - height[:, None] * up
        roof = roof_over(points, plane, config)
        top = float(np.quantile(height, MOST[1]))
    facets = hull_facets(np.concatenate([seen, feet]))
    sight = seen.mean(axis=0)
    across = normalise(np.cross(up, sight))
    ahead = np.cross(across, up)
    front, back = np.quantile(seen @ ahead, MOST)
    left, right = np.quantile(seen @ across, MOST)
    return SeenPart(
        frame=frame,
        object_id=object_id,
        plane=plane,
        seen=seen,
        feet=feet,
        facets=facets,
        roof=roof,
        size=size,
        top=top,
        ahead=ahead,
        across=across,
        front=float(front),
        back=float(back),
        middle=float(left + right) / 2,
        width=max(float(right - left), LEAST),
        depths=-_outside(seen, facets),
    )


def lengths(points: Array, part: SeenPart) -> Features:
    """(n, `COUNT`) of points (n, 3), metres, camera frame. Lengths stand in tenths of `FAR` and in
    the object's sizes; without a plane, heights count as in the middle of the object."""
    frame, size = part.frame, part.size
    behind = np.clip(np.nan_to_num(-depth_behind(points, frame)), -FAR, FAR)
    label = at_pixels(points, frame.segmap, frame)
    own = label == part.object_id
    ground = label == BACKGROUND
    outline = np.nan_to_num(at_pixels(points, _within_outline(part), frame))
    # From pixels to metres at the point's own depth.
    outline *= np.maximum(points[:, 2], 0) / frame.K[0, 0]

    outside = _outside(points, part.facets)
    away, nearest = cKDTree(part.seen).query(points)
    if part.plane is None or part.roof is None:
        height = np.full(len(points), part.top)
        over_roof = np.full(len(points), -part.top)
        beside = away
        lower = np.zeros(len(points))
    else:
        height = part.plane.signed_distance(points)
        over_roof = part.roof.above(points)
        T = part.roof.T_plane_cam
        beside, _ = cKDTree(transform_points(T, part.seen)[:, :2]).query(
            transform_points(T, points)[:, :2]
        )
        lower = (part.seen[nearest] - points) @ part.plane.normal
    # As if what is seen were the front of something round.
    across = points @ part.across - part.middle
    ahead = points @ part.ahead - part.front
    center = max(part.width, part.back - part.front) / 2
    round_ = np.hypot(across, ahead - center)
    each = [
        outside,
        away,
        beside,
        behind,
        outline,
        height,
        over_roof,
        lower,
        part.depths[nearest],
        np.abs(across),
        ahead,
        round_,
    ]
    whole = [
        size / FAR,
        part.top / size,
        part.width / size,
        (part.back - part.front) / size,
        part.depths.mean() / size,
        np.quantile(part.depths, MOST[1]) / size,
    ]
    columns = [np.clip(one / size, -RATIO, RATIO) for one in each]
    columns += [np.clip(one, -FAR, FAR) / (FAR / 10) for one in each]
    columns += [
        own,
        ground,
        np.clip(behind / (outline + 0.002), -RATIO, RATIO),
        np.clip(height / max(part.top, LEAST), -1, RATIO),
        np.clip(round_ / center, 0, RATIO),
    ]
    columns += [np.full(len(points), one) for one in whole]
    return np.stack(columns, axis=1).astype(np.float32)


COUNT = 35


def _outside(points: Array, facets: Array) -> Array:
    """Distance (n,) of points (n, 3) beyond the facets (f, 4), negative inside."""
    # In float32 about the middle, and so many points at once that their products, one for each
    # facet, stay in the cache.
    middle = points.mean(axis=0)
    near = (points - middle).astype(np.float32)
    offsets = (facets[:, 3] + facets[:, :3] @ middle).astype(np.float32)
    normals = np.ascontiguousarray(facets[:, :3].T, dtype=np.float32)
    found = np.empty(len(points))
    for start in range(0, len(points), CHUNK):
        rows = slice(start, start + CHUNK)
        found[rows] = (near[rows] @ normals + offsets).max(axis=1)
    return found


def _within_outline(part: SeenPart) -> NDArray[np.float32]:
    """(H, W) pixels from each pixel to the nearest of the background, or of the image's edge; what
    another object hides may go on."""
    ground = np.pad(part.frame.segmap == BACKGROUND, 1, constant_values=True)
    return distance_transform_edt(~ground)[1:-1, 1:-1].astype(np.float32)
