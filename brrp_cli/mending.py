"""Masks that recognised objects mend, and what they change reconstructed again."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import MendConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, project, transform_points
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import Reconstruction, Retrieved
from brrp_cli.segmentation.mend_masks import Mended, Placed, mend_masks

Again = Callable[[Frame, Collection[int]], Reconstruction]


def mend(
    result: Reconstruction,
    prior: Prior | None,
    again: Again,
    config: MendConfig,
    first_free: int = 1,
) -> Reconstruction:
    """The reconstruction after recognised objects claimed masks that they explain and gave back
    pixels that they do not (segmentation/mend_masks.py), in `config.rounds` rounds at most.

    again : reconstructs those objects of a frame whose ids are given; first_free : ids of new
    objects are this at least
    Its frame has the masks as they were mended; without a prior nothing is recognised and nothing
    changes. `seconds` gains "mending".
    """
    if prior is None:
        return result
    start = time.perf_counter()
    first = dict(result.seconds)
    for _ in range(config.rounds):
        mended = mended_masks(result, prior, config, first_free)
        if mended.segmap is result.frame.segmap:
            break
        frame = replace(result.frame, segmap=mended.segmap)
        changed = set(mended.changed) & set(frame.object_ids)
        stay = set(frame.object_ids) - changed
        kept = [each for each in result.objects if each.object_id in stay]
        result = again(frame, changed) if changed else replace(result, frame=frame)
        objects = [*kept, *(each for each in result.objects if each.object_id in changed)]
        result = replace(result, objects=sorted(objects, key=lambda each: each.object_id))
    return replace(result, seconds={**first, "mending": time.perf_counter() - start})


def mended_masks(
    result: Reconstruction, prior: Prior, config: MendConfig, first_free: int = 1
) -> Mended:
    """The frame's masks, mended by the objects that were recognised in it."""
    frame = result.frame
    placed = [
        Placed(item.object_id, float(found.weight or 0.0), rendered(found, prior, frame))
        for item in result.objects
        if (found := item.recognised) is not None and found.T_cam_object is not None
    ]
    depth = np.where(frame.valid, frame.points[..., 2], np.nan)
    with np.errstate(invalid="ignore"):
        noise = config.noise + config.noise_growth * depth**2
    tolerance = np.nan_to_num(config.sigmas * np.hypot(noise, config.pose))
    height = None if result.plane is None else result.plane.signed_distance(frame.points)
    return mend_masks(frame.segmap, depth, placed, height, tolerance, config, first_free)


def rendered(found: Retrieved, prior: Prior, frame: Frame) -> NDArray[np.float64]:
    """Depth (H, W), metres, of the stored object as it was placed and seen alone; 0 elsewhere."""
    assert found.T_cam_object is not None
    shape = prior.load(found.name).shape
    vertices = transform_points(found.T_cam_object, shape.vertices.astype(np.float64))
    depth = np.zeros(frame.shape)
    if (vertices[:, 2] <= 0).any():
        return depth
    # Only the window of the image that the object fills is looked into.
    pixels = project(vertices, frame.K)
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int), 0, frame.shape[::-1])
    high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 1, 0, frame.shape[::-1])
    window = (slice(low[1], high[1]), slice(low[0], high[0]))
    if depth[window].size:
        # Rays with z = 1 go as often as the depth is.
        length, _ = shape.met(
            found.T_cam_object, backproject(np.ones(frame.shape), frame.K)[window]
        )
        depth[window] = np.where(np.isfinite(length), length, 0.0)
    return depth
