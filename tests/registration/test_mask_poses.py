"""Solids that a depth camera does not see, placed by their masks alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import MESHES, TABLE, K, in_camera, photograph, placed, stored

from brrp_cli.config.seen_mask import MaskPosesConfig
from brrp_cli.geometry import backproject, transform_points
from brrp_cli.registration.mask_poses import mask_outline, poses_from_mask
from brrp_cli.registration.model import search_model

CONFIG = MaskPosesConfig()


def poses(name, where):
    frame = photograph({1: in_camera(MESHES[name](), where)})
    blind = np.where(frame.segmap == 1, np.nan, frame.depth)
    frame = replace(frame, points=backproject(blind.astype(np.float32), K))
    seen = mask_outline(frame, 1, TABLE, CONFIG)
    model = search_model(stored(name))
    return model, poses_from_mask(model, seen, CONFIG)


@pytest.mark.parametrize("name", ["box", "ell", "beaker", "ball"])
@pytest.mark.parametrize("x, y, yaw", [(0.0, 0.0, 0.3), (0.12, -0.1, 2.0), (-0.1, 0.08, -1.3)])
def test_the_mask_alone_tells_where_a_known_solid_stands(name, x, y, yaw):
    """One of its best placements covers the truth: its points lie on the true surface."""
    where = placed(x, y, yaw)
    model, found = poses(name, where)
    T_model_cam = np.linalg.inv(found)
    middle = stored(name).center
    true = transform_points(where, model.surface + middle)
    off = [np.abs(model.signed_distance(transform_points(T, true))).mean() for T in T_model_cam]
    assert min(off) < 0.004


def test_a_model_that_rests_in_no_pose_is_not_placed():
    model, _ = poses("box", placed(0, 0, 0))
    lying = replace(model, stored=replace(model.stored, poses=[]))
    frame = photograph({1: in_camera(MESHES["box"](), placed(0, 0, 0))})
    assert poses_from_mask(lying, mask_outline(frame, 1, TABLE, CONFIG), CONFIG).shape == (0, 4, 4)
