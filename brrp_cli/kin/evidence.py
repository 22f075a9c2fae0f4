"""What a frame says of one object to which shapes are to be fitted: where its surface was seen, and
where it cannot be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt, minimum_filter

from brrp_cli.config import KinConfig, SensorConfig
from brrp_cli.frames.dilate import dilated, mask_box
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.last_frame import kept_for_last_frame
from brrp_cli.frames.projection import at_pixels
from brrp_cli.geometry import transform_points
from brrp_cli.observation.sensor_noise import depth_deviation
from brrp_cli.observation.subsample import dense_points, grid_subsample
from brrp_cli.observation.support_plane import Plane, plane_frame

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class OtherDepth:
    """The frame of another view of the object; T_view_cam : (4, 4) rigid, from the present frame's
    camera to that one's"""

    frame: Frame
    object_id: int
    T_view_cam: Array


@dataclass(frozen=True)
class Evidence:
    """Metres, in the frame of the support plane (z up, 0 on it), in random order.

    seen : (n, 3) points of the surface; free : (m, 3) of space that was seen to be free, most of it
    about the silhouette; eye : (3,) the camera; T_cam_plane : (4, 4)
    depth : (H, W) metres, NaN beside the silhouette, where a pixel may be anyone's; noise : metres,
    standard deviation of one depth measurement; others : depth, frame and T_view_cam (4, 4) of
    other views of it
    """

    seen: Floats
    free: Floats
    eye: Floats
    T_cam_plane: Array
    frame: Frame
    depth: Floats
    noise: float
    others: tuple[tuple[Floats, Frame, Array], ...] = ()

    def free_depth(self, points: NDArray[np.floating]) -> Array:
        """How far (n,) points (n, 3), metres, camera frame, stand in space that was seen to be
        free; NaN where nothing tells: beside the silhouette, where a pixel may be anyone's."""
        gap = at_pixels(points, self.depth, self.frame) - points[:, 2]
        for depth, frame, T_view_cam in self.others:
            there = transform_points(T_view_cam, points)
            gap = np.fmax(gap, at_pixels(there, depth, frame) - there[:, 2])
        return np.asarray(gap)


def gather(
    points: NDArray[np.floating],
    frame: Frame,
    object_id: int,
    plane: Plane,
    config: KinConfig,
    sensor: SensorConfig,
    rng: np.random.Generator,
    others: Sequence[NDArray[np.floating]] = (),
    depths: Sequence[OtherDepth] = (),
) -> Evidence:
    """From an object's observed points (n, 3), metres, camera frame. They are merged in cells, so
    that near and far parts count alike, and so would what is smeared beyond the object's edges: it
    is left out.

    others : (n, 3) points of other views of it, likewise: its surface was seen there too; depths :
    what these measured
    """
    T_plane_cam = plane_frame(plane)
    points = dense_points(points, config.dense_cell, config.least_dense)
    known = [dense_points(each, config.dense_cell, config.least_dense) for each in others]
    seen = grid_subsample(np.concatenate([points, *known]), config.cell)
    seen = rng.permutation(seen)[: config.seen_points]
    free = _free(points, frame, object_id, config, rng)
    placed = transform_points(T_plane_cam, free).astype(np.float32)
    # Below the plane nothing is, and everything about it says so already.
    return Evidence(
        transform_points(T_plane_cam, seen.astype(np.float64)).astype(np.float32),
        placed[placed[:, 2] > 0],
        T_plane_cam[:3, 3].astype(np.float32),
        np.asarray(np.linalg.inv(T_plane_cam), dtype=np.float64),
        frame,
        _told_depth(frame, object_id, config),
        float(depth_deviation(np.median(points[:, 2]), sensor)),
        tuple(
            (_told_depth(each.frame, each.object_id, config), each.frame, each.T_view_cam)
            for each in depths
        ),
    )


def _told_depth(frame: Frame, object_id: int, config: KinConfig) -> Floats:
    """Depth (H, W), the nearest of all pixels within `config.blur`: space is free where all of them
    say so. NaN at pixels of others within the ring of those that may be anyone's."""
    depth = _nearest_depth(frame, config.blur).copy()
    own = frame.segmap == object_id
    depth[dilated(own, config.ring[0]) & ~own] = np.nan
    return depth


@kept_for_last_frame
def _nearest_depth(frame: Frame, blur: int) -> Floats:
    """Depth (H, W), the nearest of all pixels within `blur`, NaN where none is measured."""
    known = np.where(np.isfinite(frame.depth), frame.depth, np.inf)
    nearest = minimum_filter(known, size=2 * blur + 1)
    told = np.isfinite(frame.depth) & np.isfinite(nearest)
    return np.where(told, nearest, np.nan).astype(np.float32)


def _free(
    points: NDArray[np.floating],
    frame: Frame,
    object_id: int,
    config: KinConfig,
    rng: np.random.Generator,
) -> Array:
    """Points (m, 3), camera frame, of free space: in front of what was seen of the object, and
    beside it, at depths that it may have."""
    mask = frame.segmap == object_id
    inner, outer = config.ring
    window = mask_box(mask, outer + 1)
    own, depth = mask[window], frame.points[..., 2][window]
    beside = binary_dilation(own, iterations=outer) & ~binary_dilation(own, iterations=inner)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    low, high = float(points[:, 2].min()) - size / 4, float(points[:, 2].max()) + size / 2
    told = own & np.isfinite(depth)
    nearest = distance_transform_edt(~told, return_distances=False, return_indices=True)
    at_edge = depth[tuple(nearest)].astype(np.float64)
    found = []
    for where, share in ((beside, config.free_beside), (own, 1 - config.free_beside)):
        at = np.flatnonzero((where & np.isfinite(depth)).ravel())
        if not len(at):
            continue
        count = int(share * config.free_points)
        pixel = at[rng.integers(len(at), size=2 * count)]
        measured = depth.ravel()[pixel].astype(np.float64)
        end = np.minimum(high, measured - config.free_gap)
        kept = end > low
        pixel, end = pixel[kept][:count], end[kept][:count]
        v, u = np.divmod(pixel, own.shape[1])
        z = low + (end - low) * rng.random(len(pixel))
        if where is own:
            # What is hollow shows in what lies just in front of its inside.
            z = end - (end - low) * rng.random(len(pixel)) ** 2
        else:
            # And where it ends, in what lies beside its edge, no nearer and no further.
            edge = at_edge.ravel()[pixel] + config.edge * size * rng.standard_normal(len(pixel))
            z = np.where(rng.random(len(pixel)) < config.at_edge, np.minimum(edge, end), z)
        x = (u + window[1].start - frame.K[0, 2]) / frame.K[0, 0]
        y = (v + window[0].start - frame.K[1, 2]) / frame.K[1, 1]
        found.append(np.stack([x * z, y * z, z], axis=1))
    free = np.concatenate(found) if found else np.zeros((0, 3))
    return np.asarray(rng.permutation(free))
