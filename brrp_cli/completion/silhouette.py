"""What an object's silhouette in the image says: how far within it a pixel lies, and how thick the
part of the object is that the pixel shows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from brrp_cli.config import CompletionConfig
from brrp_cli.frames.frame import BACKGROUND, Frame

Image = NDArray[np.float32]


def silhouettes(frame: Frame, object_id: int, config: CompletionConfig) -> tuple[Image, Image]:
    """`within_silhouette` and `local_thickness` (H, W) where the object is or may
    go on, 0 elsewhere."""
    rows, columns = np.nonzero(frame.segmap == object_id)
    margin = int(np.ptp(rows) + np.ptp(columns)) // 4 + 2
    window = tuple(
        slice(max(0, int(each.min()) - margin), int(each.max()) + margin + 1)
        for each in (rows, columns)
    )
    silhouette, thickness = np.zeros((2, *frame.shape), dtype=np.float32)
    silhouette[window] = within_silhouette(frame.segmap[window])
    thickness[window] = _thinned_thickness(silhouette[window], config)
    return silhouette, thickness


def within_silhouette(segmap: NDArray[np.integer]) -> Image:
    """(H, W) pixels from each pixel to the nearest of the background, or of the image's edge; what
    another object hides may go on."""
    ground = np.pad(segmap == BACKGROUND, 1, constant_values=True)
    return distance_transform_edt(~ground)[1:-1, 1:-1].astype(np.float32)


def _thinned_thickness(within: Image, config: CompletionConfig) -> Image:
    """`local_thickness` of every so many pixels, repeated."""
    step = 1 + max(within.shape) // config.thickness_side
    if step == 1:
        return local_thickness(within, config.radii)
    thick = local_thickness(within[::step, ::step] / step, config.radii) * step
    rows, columns = within.shape
    repeated = thick.repeat(step, axis=0)[:rows].repeat(step, axis=1)[:, :columns]
    return np.where(within > 0, repeated, 0).astype(np.float32)


def local_thickness(within: Image, radii: int) -> Image:
    """(H, W) pixels, the radius of the largest disc within the silhouette that has the pixel in
    it: of a handle or a stalk it is small, however large the object."""
    width = within.copy()
    top = float(within.max())
    for radius in np.geomspace(2, top, radii) if top > 2 else ():
        reached = distance_transform_edt(within < radius) <= radius
        width[reached & (width < radius)] = radius
    return np.where(within > 0, width, 0).astype(np.float32)
