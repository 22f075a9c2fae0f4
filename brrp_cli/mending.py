"""Masks that recognised objects mend, and what they change reconstructed again."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import MendConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import project, transform_points
from brrp_cli.prior.store import Prior
from brrp_cli.raycast import look
from brrp_cli.reconstruction import Reconstruction, Retrieved
from brrp_cli.segmentation.mend_masks import Mended, Placed, mend_masks

Again = Callable[[Frame, Collection[int]], Reconstruction]


def mend(
    result: Reconstruction, prior: Prior | None, again: Again, config: MendConfig
) -> Reconstruction:
    """The reconstruction after recognised objects claimed masks that they explain and gave back
    pixels that they do not (segmentation/mend_masks.py), in `config.rounds` rounds at most.

    again : reconstructs those objects of a frame whose ids are given
    Its frame has the masks as they were mended; without a prior nothing is recognised and nothing
    changes. `seconds` gains "mending".
    """
    if prior is None:
        return result
    start = time.perf_counter()
    first = dict(result.seconds)
    for _ in range(config.rounds):
        mended = mended_masks(result, prior, config)
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


def mended_masks(result: Reconstruction, prior: Prior, config: MendConfig) -> Mended:
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
    return mend_masks(frame.segmap, depth, placed, height, tolerance, config)


def rendered(found: Retrieved, prior: Prior, frame: Frame) -> NDArray[np.float32]:
    """Depth (H, W), metres, of the stored object as it was placed and seen alone; 0 elsewhere."""
    import trimesh

    assert found.T_cam_object is not None
    shape = prior.load(found.name).shape
    vertices = transform_points(found.T_cam_object, shape.vertices.astype(np.float64))
    depth = np.zeros(frame.shape, dtype=np.float32)
    if (vertices[:, 2] <= 0).any():
        return depth
    # Only the window of the image that the object fills is looked into.
    pixels = project(vertices, frame.K)
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int), 0, frame.shape[::-1])
    high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 1, 0, frame.shape[::-1])
    if (high <= low).any():
        return depth
    K = frame.K.copy()
    K[:2, 2] -= low
    mesh = trimesh.Trimesh(vertices, shape.faces, process=False)
    sight = look([mesh], K, (int(high[1] - low[1]), int(high[0] - low[0])))
    depth[low[1] : high[1], low[0] : high[0]] = sight.depth
    return depth
