"""How the silhouette of a placed model agrees with an object's mask.

Where depth says nothing, as of what is dark, shiny or clear, the mask still does: a coin does not
cover the mask of a knife, however well it lies on the points that are seen of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.seen_mask import SilhouetteConfig
from brrp_cli.distance_loops import nearest_along
from brrp_cli.frames.dilate import dilated, mask_box
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.registration.model import ModelGeometry
from brrp_cli.registration.transform_loops import inverses

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Silhouette:
    """Rays of pixels in and beside a mask, without those at its edge; camera frame, z = 1.

    own : (n, 3) in it; beside : (m, 3) around it; depth : (m,) metres, of what stands there, inf
    where nothing would hide the object; worth : pixels that stand for one of those beside it, as a
    share of the mask
    """

    own: Array
    beside: Array
    depth: Array
    worth: float


def silhouette(frame: Frame, object_id: int, config: SilhouetteConfig) -> Silhouette:
    """The silhouette of an object of the frame."""
    mask = frame.segmap == object_id
    tight = mask_box(mask, 0)
    around = round(config.around * max(side.stop - side.start for side in tight))
    box = mask_box(mask, max(around, config.least_around))
    window = np.pad(mask[box], config.edge)
    inside = tuple(slice(config.edge, size - config.edge) for size in window.shape)
    beside = ~dilated(window, config.edge)[inside]
    own = ~dilated(~window, config.edge)[inside]
    if not own.any():
        own = mask[box]
    corner = box[0].start, box[1].start
    rows, columns = _evenly(beside, config.rays_beside, corner)
    depth = frame.depth[rows, columns].astype(np.float64)
    hidden = np.where(frame.segmap[rows, columns] == BACKGROUND, np.inf, -np.inf)
    return Silhouette(
        own=_rays(frame, *_evenly(own, config.rays, corner)),
        beside=_rays(frame, rows, columns),
        depth=np.where(np.isfinite(depth) & (depth > 0), depth, hidden),
        worth=float(beside.sum() / max(len(rows), 1) / max(own.sum(), 1)),
    )


def bare_and_spilled(
    T_cam_model: Array,
    model: ModelGeometry,
    seen: Silhouette,
    tolerance: float,
    config: SilhouetteConfig,
) -> tuple[Array, Array]:
    """Of placements T_cam_model (b, 4, 4), rigid: the shares (b,) of the mask that the model leaves
    bare, and what it covers beside the mask with nothing in front, as shares of the mask (b,).

    tolerance : metres by which measured depth errs
    """
    T_model_cam = inverses(np.ascontiguousarray(T_cam_model, dtype=np.float64))
    field, unit = model.field, model.half_extent
    grid = field.values, field.lower, field.spacing, unit, T_model_cam
    off, _ = nearest_along(*grid, seen.own)
    bare = (off > max(config.near, config.nodes * field.spacing * unit)).mean(axis=1)
    off, z = nearest_along(*grid, seen.beside)
    shown = (off < config.touched) & (seen.depth > z - tolerance)
    return bare, shown.sum(axis=1) * seen.worth


def _evenly(
    mask: NDArray[np.bool_], count: int, corner: tuple[int, int]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns (n,) of the image of at most `count` pixels of a part (h, w) of it."""
    rows, columns = np.nonzero(mask)
    kept = np.linspace(0, len(rows) - 1, min(count, len(rows))).astype(np.intp)
    return rows[kept] + corner[0], columns[kept] + corner[1]


def _rays(frame: Frame, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Array:
    K = frame.K
    return np.stack(
        [(columns - K[0, 2]) / K[0, 0], (rows - K[1, 2]) / K[1, 1], np.ones(len(rows))], axis=1
    )
