"""What a depth image shows of the errors of the camera that took it, without ground truth.

All of it is read against the table, which is a plane: `table_residual` subtracts the plane along
each ray, and the other functions describe what is left. Lengths in pixels are pixels of the image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brrp_cli.config.table import TableConfig
from brrp_cli.geometry import backproject
from brrp_cli.observation.support_plane import largest_plane
from brrp_cli.segmentation.table_plane import Table, find_table

SMOOTHING = 5.0  # pixels, standard deviation: a window of about 20 pixels
ON_TABLE = 0.008  # metres perpendicular to the plane
MARGIN = 8  # pixels between the table's pixels that are measured and anything that stands on it
STEP = 0.05  # metres along the ray: what is taken as a silhouette
REACH = 10  # valid pixels in which a silhouette has to rise by STEP
COLOUR_REACH = 10  # pixels beside a depth edge in which its colour edge is sought
FACE_PIXELS = 1500
FACE_TOLERANCE = 0.006  # metres
FLAT = 2.0  # 1/metres: what bends more is no face of a box


@dataclass(frozen=True)
class TableResidual:
    """Depth less the depth of the table's plane on the same ray.

    residual : (H, W) float64, metres, NaN without return or where the ray misses the plane
    table : (H, W) bool, pixels of the table, `MARGIN` pixels away from all else
    region : (H, W) bool, rays that meet the plane inside the table's outline, return or not
    """

    residual: NDArray[np.float64]
    table: NDArray[np.bool_]
    region: NDArray[np.bool_]


def table_residual(depth: NDArray[np.floating], K: NDArray[np.float64]) -> TableResidual:
    """The residual of depth (H, W), metres, 0 = no return. Errors: FrameError without a table."""
    valid = depth > 0
    points = backproject(depth, K).astype(np.float64)
    found = find_table(points[valid], 0, None, TableConfig())
    normal, offset = found.plane.normal, found.plane.offset
    rays = backproject(np.ones(depth.shape), K).astype(np.float64)
    for _ in range(3):
        near = valid & (np.abs(points @ normal + offset) < ON_TABLE)
        near = _largest(ndimage.binary_erosion(near, iterations=2))
        on = points[near]
        center = on.mean(axis=0)
        fitted = np.linalg.svd((on - center).T @ (on - center))[0][:, 2]
        normal = fitted * np.sign(fitted @ normal)
        offset = -float(center @ normal)
    slope = rays @ normal
    plane = np.where(slope < -1e-3, -offset / np.where(slope < -1e-3, slope, -1.0), np.nan)
    residual = np.where(valid, depth, np.nan) - plane
    return TableResidual(
        residual=residual,
        table=_away_from_others(near, valid),
        region=_region(rays, plane, found),
    )


def _largest(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    labels, _ = ndimage.label(mask)
    return np.asarray(labels == np.bincount(labels[mask], minlength=2).argmax()) & mask


def _away_from_others(near: NDArray[np.bool_], valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    # Single missing or wild pixels on the table are noise; larger ones are other things.
    others = ndimage.binary_opening(valid & ~near, iterations=2)
    close = ndimage.binary_dilation(others, iterations=MARGIN + 2)
    return np.asarray(near & ~close)


def _region(
    rays: NDArray[np.float64], plane: NDArray[np.float64], table: Table
) -> NDArray[np.bool_]:
    ahead = np.isfinite(plane) & (plane > 0)
    inside = np.zeros(plane.shape, dtype=bool)
    points = rays[ahead] * plane[ahead][:, None]
    inside[ahead] = table.holds(table.plan(points), 0.0)
    return inside


def waves_and_fine(
    residual: NDArray[np.float64], mask: NDArray[np.bool_], smoothing: float = SMOOTHING
) -> tuple[float, float]:
    """Standard deviations, metres: of the residual smoothed over the mask, and of what is left."""
    return _split(np.nan_to_num(residual), mask & np.isfinite(residual), smoothing)


def _split(
    residual: NDArray[np.float64], mask: NDArray[np.bool_], smoothing: float
) -> tuple[float, float]:
    weight = ndimage.gaussian_filter(mask.astype(np.float64), smoothing)
    smooth = ndimage.gaussian_filter(np.where(mask, residual, 0.0), smoothing)
    smooth /= np.maximum(weight, 1e-6)
    return float(smooth[mask].std()), float((residual - smooth)[mask].std())


def quantisation_step(depth: NDArray[np.floating], mask: NDArray[np.bool_]) -> float:
    """Median gap between the depth values that occur in the mask, in metres at 1 m.

    A step of disparity is a gap that grows with depth squared, so each gap is divided by it.
    """
    values = np.unique(np.round(depth[mask].astype(np.float64), 6))
    if len(values) < 3:
        return float("nan")
    middle = (values[1:] + values[:-1]) / 2
    return float(np.median(np.diff(values) / middle**2))


def holes(depth: NDArray[np.floating], region: NDArray[np.bool_]) -> float:
    """Share of a region's pixels that have no return."""
    return float((depth[region] <= 0).mean())


@dataclass(frozen=True)
class Silhouettes:
    """Silhouettes of things in front of the table, found along rows and columns.

    flying : mean number of pixels between the table's depth and the thing's
    holes_left, holes_right, holes_top : mean number of missing pixels on that side of things
    count : how many crossings were found
    """

    flying: float
    holes_left: float
    holes_right: float
    holes_top: float
    count: int
    edges: NDArray[np.int64]


def silhouettes(residual: NDArray[np.float64]) -> Silhouettes:
    """Cross every silhouette from the table inwards: from the left, the right and the top."""
    sides = {}
    edges = []
    height, width = residual.shape
    index = np.arange(height * width).reshape(height, width)
    views = {
        "left": (residual, index),
        "right": (residual[:, ::-1], index[:, ::-1]),
        "top": (residual.T, index.T),
    }
    for side, (lines, numbers) in views.items():
        found = [_crossings(line, number) for line, number in zip(lines, numbers, strict=True)]
        sides[side] = np.array([c for line in found for c in line], dtype=np.float64).reshape(-1, 4)
        rows, columns = np.unravel_index(sides[side][:, 2].astype(np.int64), (height, width))
        edges.append(np.stack([rows, columns, np.full(len(rows), side == "top")], axis=1))
    every = np.concatenate(list(sides.values()))
    means = {
        side: float(found[:, 1].mean()) if len(found) else np.nan for side, found in sides.items()
    }
    return Silhouettes(
        flying=float(every[:, 0].mean()) if len(every) else float("nan"),
        holes_left=means["left"],
        holes_right=means["right"],
        holes_top=means["top"],
        count=len(every),
        edges=np.concatenate(edges),
    )


def _crossings(line: NDArray[np.float64], index: NDArray[np.int64]) -> list[tuple[float, ...]]:
    """(flying, holes, pixel index of the edge, 0) of each rise from the table along a line."""
    known = np.flatnonzero(np.isfinite(line))
    values = line[known]
    flat = np.abs(values) < ON_TABLE * 2
    found = []
    for start in np.flatnonzero(flat[:-1] & ~flat[1:]):
        ahead = values[start + 1 : start + 1 + REACH]
        risen = np.flatnonzero(ahead < -STEP)
        if not len(risen) or start < 3 or not flat[start - 3 : start].all():
            continue
        plateau = np.median(values[start + 1 + risen[0] + 2 : start + 1 + risen[0] + 7])
        if not plateau < -STEP:
            continue
        last = np.flatnonzero(values[start + 1 : start + 1 + 2 * REACH] < 0.8 * plateau)
        if not len(last):
            continue
        end = start + 1 + last[0]
        missing = known[end] - known[start] - (end - start)
        found.append((float(last[0]), float(missing), float(index[known[end]]), 0.0))
    return found


def edge_offsets(rgb: NDArray[np.uint8], edges: NDArray[np.int64]) -> float:
    """Spread (1.48 x median absolute deviation), pixels, of the distance between a depth edge and
    the strongest colour edge within `COLOUR_REACH` of it, along the row or column it was found in.

    edges : (n, 3) row, column, 1 if found along a column
    """
    grey = ndimage.gaussian_filter(rgb.astype(np.float64).mean(axis=-1), 1.0)
    gradient = (np.abs(np.gradient(grey, axis=1)), np.abs(np.gradient(grey, axis=0)))
    offsets = []
    steps = np.arange(-COLOUR_REACH, COLOUR_REACH + 1)
    height, width = grey.shape
    for row, column, along in edges:
        rows = row + steps * along
        columns = column + steps * (1 - along)
        if rows.min() < 0 or columns.min() < 0 or rows.max() >= height or columns.max() >= width:
            continue
        strength = gradient[along][rows, columns]
        if strength.max() > 8:
            offsets.append(steps[strength.argmax()])
    if len(offsets) < 20:
        return float("nan")
    return float(1.4826 * np.median(np.abs(offsets - np.median(offsets))))


def face_residuals(
    depth: NDArray[np.floating], K: NDArray[np.float64], masks: NDArray[np.integer]
) -> list[tuple[float, float]]:
    """Waves and fine noise, metres along the ray, on each flat face of a masked object."""
    points = backproject(depth, K).astype(np.float64)
    rays = backproject(np.ones(depth.shape), K).astype(np.float64)
    found = []
    for number in np.unique(masks[masks > 0]):
        mask = ndimage.binary_erosion((masks == number) & (depth > 0), iterations=4)
        if mask.sum() < FACE_PIXELS:
            continue
        model = largest_plane(
            points[mask],
            int(number),
            tolerance=FACE_TOLERANCE,
            iterations=500,
            drawn_points=4_000,
            min_points=100,
        )
        if model is None:
            continue
        distance = points @ model[:3] + model[3]
        face = _largest(mask & (np.abs(distance) < FACE_TOLERANCE))
        if face.sum() < FACE_PIXELS:
            continue
        on = points[face]
        center = on.mean(axis=0)
        axes = np.linalg.svd((on - center).T @ (on - center))[0].T
        local = (on - center) @ axes.T
        if _curvature(local) > FLAT:
            continue
        plane = float(center @ axes[2]) / (rays @ axes[2])
        found.append(_split(np.where(face, depth - plane, 0.0), face, SMOOTHING))
    return found


def _curvature(local: NDArray[np.float64]) -> float:
    """Largest curvature, 1/metres, of the quadric z(x, y) through points (n, 3)."""
    x, y, z = local.T
    terms = np.stack([np.ones(len(x)), x, y, x**2, x * y, y**2], axis=1)
    _, _, _, xx, xy, yy = np.linalg.lstsq(terms, z, rcond=None)[0]
    return float(np.abs(np.linalg.eigvalsh([[2 * xx, xy], [xy, 2 * yy]])).max())
