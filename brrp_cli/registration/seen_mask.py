"""What an object's mask says of where stored ones lie, where depth shows too little of it.

Of what is dark, shiny or clear a camera measures a few points, if any. Many placements lie well
over those. The mask is whole all the same: a placed object covers it and nothing beside it, and
reaches as far as it in every direction of the image. How far away it is follows from where it
stands: few things touch the table nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.seen_mask import SeenMaskConfig
from brrp_cli.frames.dilate import dilated, mask_box
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane
from brrp_cli.registration.mask_edges import MaskEdges, mask_edges
from brrp_cli.registration.mask_poses import MaskOutline, mask_outline, poses_from_mask
from brrp_cli.registration.model import ModelGeometry
from brrp_cli.registration.silhouette import Silhouette, bare_and_spilled, silhouette

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SeenMask:
    """The mask of an object of which depth shows little.

    plane : that it may stand on; outline : None without one; edges : where nothing hides it
    trust : in its points, 0 to 1; lost : (H, W) its pixels that have no depth
    depth : (H, W) metres, of the frame, NaN at its edge
    """

    silhouette: Silhouette
    plane: Plane | None
    outline: MaskOutline | None
    edges: MaskEdges
    trust: float
    lost: NDArray[np.bool_]
    depth: NDArray[np.float32]
    config: SeenMaskConfig

    def poses(self, model: ModelGeometry) -> Array:
        """T_cam_model (b, 4, 4) of a model that rests on the plane, as the mask suggests them."""
        if self.outline is None:
            return np.zeros((0, 4, 4))
        return poses_from_mask(model, self.outline, self.config.by_mask)

    def believed(self, explained: Array) -> Array:
        """What points say for placements (b,), as far as they are trusted."""
        return self.trust * explained + (1 - self.trust) * self.config.usual

    def against(self, T_cam_model: Array, model: ModelGeometry, tolerance: float) -> Array:
        """What it says against placements (b, 4, 4), in alignment scores (b,). tolerance : metres
        by which measured depth errs"""
        config = self.config
        bare, spilled = bare_and_spilled(
            T_cam_model, model, self.silhouette, tolerance, config.silhouette
        )
        unlike = config.bare * bare + config.spilled * np.log1p(spilled)
        return np.asarray(unlike + (1 - self.trust) * self._astray(T_cam_model, model))

    def _astray(self, T_cam_model: Array, model: ModelGeometry) -> Array:
        """What speaks against placements (b, 4, 4) that float above the plane or sink below it, in
        alignment scores (b,)."""
        if self.plane is None:
            return np.zeros(len(T_cam_model))
        surface = model.surface[: self.config.points]
        up = self.plane.normal @ T_cam_model[:, :3, :3]
        lowest = (up @ surface.T).min(axis=1) + T_cam_model[:, :3, 3] @ self.plane.normal
        height = np.minimum(np.abs(lowest + self.plane.offset), self.config.high)
        return np.asarray(self.config.astray / self.config.high * height)


def seen_mask(
    frame: Frame, object_id: int, points: int, plane: Plane | None, config: SeenMaskConfig
) -> SeenMask | None:
    """The mask of an object of the frame with so many points; None where depth shows enough."""
    mask = frame.segmap == object_id
    if points >= config.blind * mask.sum():
        return None
    edge, box = np.zeros_like(mask), mask_box(mask, config.edge_width)
    edge[box] = mask[box] & dilated(~mask[box], config.edge_width)
    inner = frame.valid & mask & ~edge
    return SeenMask(
        silhouette(frame, object_id, config.silhouette),
        plane,
        None if plane is None else mask_outline(frame, object_id, plane, config.by_mask),
        mask_edges(frame, object_id, config),
        min(1.0, float(inner.sum()) / config.trusted),
        mask & ~frame.valid,
        np.where(edge, np.float32(np.nan), frame.depth),
        config,
    )
