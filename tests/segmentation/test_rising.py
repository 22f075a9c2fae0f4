"""What rises from a table far away, whose noise is larger than flat things are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter
from table_scene import K, in_camera, photograph

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.build import make_frame
from brrp_cli.segmentation.segment import segment
from brrp_cli.shapes import solids

DISTANCE, WAVES = 1.7, 0.012  # metres


def test_waves_of_a_far_table_are_no_objects_and_a_box_is():
    T_world_cam = camera_pose(np.array([0.0, 0.0, 0.03]), DISTANCE, 0.9, 0.4)
    box = in_camera(solids.box(0.2, 0.16, 0.2), np.linalg.inv(T_world_cam))
    frame = photograph({1: box}, T_world_cam=T_world_cam)
    waves = gaussian_filter(np.random.default_rng(0).normal(size=frame.shape), 5.0)
    waves *= WAVES / waves.std() * (frame.depth / DISTANCE) ** 2
    depth = np.where(frame.depth > 0, frame.depth + waves, 0.0)
    wavy = make_frame(rgb=frame.rgb, depth=depth, K=K)
    found = segment(wavy)
    truth = frame.segmap == 1
    shares = [
        ((found == i) & truth).sum() / ((found == i) | truth).sum()
        for i in range(1, found.max() + 1)
    ]
    assert max(shares) > 0.8
    # The limit of what is near makes objects of the waves.
    as_near = segment(wavy, config=replace(SegmentConfig(), far=100.0))
    assert found.max() * 4 < as_near.max()
