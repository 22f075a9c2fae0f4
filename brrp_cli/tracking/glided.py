"""Masks of an earlier frame that hold in this one, though the camera has moved: it shows the same
objects from about the same side, and nothing else that could be one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import GlideConfig, TrackConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.dilate import opened
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.projection import pixel_numbers
from brrp_cli.geometry import backproject, inverse, transform_points
from brrp_cli.observation.support_plane import Plane
from brrp_cli.tracking.carried import rests
from brrp_cli.tracking.motion import camera_motion, camera_stands, noisier, same_side
from brrp_cli.tracking.unchanged import slides

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class _Shown:
    """What an earlier frame showed of each pixel (H, W) of this one.

    same : the same surface; labels : its masks there
    outside : nothing, as its image did not reach there; come : what is farther off than this;
    recoloured : the same surface in another colour; hidden : nothing, as something was in front
    """

    same: Mask
    labels: NDArray[np.int64]
    outside: Mask
    come: Mask
    recoloured: Mask
    hidden: Mask


def glided(then: Frame, now: Frame, plane: Plane | None, config: TrackConfig) -> Frame | None:
    """This frame with the masks of an earlier one; None where they do not hold, and before a camera
    that stands.

    plane : what the objects of the earlier frame stand on, its camera frame; None = not known
    """
    own = config.glide
    T_now_then = camera_motion(then, now, config)
    if own is None or T_now_then is None or camera_stands(T_now_then, config):
        return None
    for object_id in then.object_ids:
        at_rest = rests(then, now, T_now_then, object_id, config.carry)
        if not at_rest or not same_side(then.object_points(object_id), T_now_then, own):
            return None
    shown = _shown(then, now, inverse(T_now_then), config)
    if shown.outside.sum() > own.outside * now.valid.sum():
        return None
    # Seen flatly, a table is as level as ever where its depth wavers by centimetres.
    rising = _rising(now, plane, T_now_then, own)
    changed = shown.come & rising | shown.recoloured
    for other in (changed, shown.hidden & rising):
        if other.any() and opened(other, config.carry.opening).sum() >= config.carry.least_pixels:
            return None
    segmap = _filled(shown, now, config)
    # Bled depth goes with the side: as a line at most.
    wide = opened(changed, 1)
    if any(slides(segmap == i, wide, config) for i in np.unique(segmap) if i):
        return None
    return now.with_masks(segmap)


def _shown(then: Frame, now: Frame, T_then_now: NDArray[np.float64], config: TrackConfig) -> _Shown:
    # What has no depth is taken to be as deep as what is beside it: holes move with their things.
    points = transform_points(T_then_now, backproject(_whole(now), now.K).reshape(-1, 3))
    pixel, inside = pixel_numbers(points, then)
    gap = _whole(then).ravel()[pixel] - points[:, 2]
    near = config.carry.gap * noisier(points[:, 2])
    colour = np.abs(then.rgb.reshape(-1, 3)[pixel].astype(np.int16) - now.rgb.reshape(-1, 3))
    measured = inside & now.valid.ravel()
    same = inside & (np.abs(gap) <= near)
    both = measured & then.valid.ravel()[pixel] & same
    labels = np.where(same, then.segmap.ravel()[pixel], BACKGROUND)
    shape = now.shape
    return _Shown(
        same.reshape(shape),
        labels.reshape(shape).astype(np.int64),
        outside=~inside.reshape(shape) & now.valid,
        come=(measured & (gap > near)).reshape(shape),
        recoloured=(both & (colour.mean(axis=-1) > config.colour)).reshape(shape),
        hidden=(measured & (gap < -near)).reshape(shape),
    )


def _whole(frame: Frame) -> NDArray[np.float64]:
    """Depth (H, W), that of the nearest pixel where there is none."""
    near = import_library("scipy.ndimage").distance_transform_edt(
        ~frame.valid, return_distances=False, return_indices=True
    )
    return frame.depth[tuple(near)].astype(np.float64)


def _rising(
    now: Frame, plane: Plane | None, T_now_then: NDArray[np.float64], config: GlideConfig
) -> Mask:
    """What is (H, W) higher than the table, as far as anybody knows where that is."""
    if plane is None:
        return now.valid
    height = plane.moved(T_now_then).signed_distance(now.points)
    return now.valid & (height > config.height * noisier(now.depth))


def _filled(shown: _Shown, now: Frame, config: TrackConfig) -> NDArray[np.int64]:
    """Masks (H, W); what is seen for the first time is of what is beside it, if it is as deep."""
    unknown = now.valid & ~shown.same
    near = import_library("scipy.ndimage").distance_transform_edt(
        ~(now.valid & shown.same), return_distances=False, return_indices=True
    )
    step = np.abs(now.depth - now.depth[tuple(near)])
    beside = unknown & (step <= config.carry.gap)
    return np.where(beside, shown.labels[tuple(near)], shown.labels)
