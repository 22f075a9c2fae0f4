"""How far masks and placed shapes reach in the image."""

from __future__ import annotations

import numpy as np
from sparse_depth import in_patches
from table_scene import MESHES, T_WORLD_CAM, TABLE, K, in_camera, photograph, placed, stored

from brrp_cli.config import RayRefinementConfig, SensorConfig
from brrp_cli.config.seen_mask import SeenMaskConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.mask_edges import mask_edges
from brrp_cli.registration.ray_refinement import refine_by_rays
from brrp_cli.registration.seen_mask import seen_mask

CONFIG = SeenMaskConfig()
WHERE = placed(0.0, 0.0, 0.5)


def truth(name):
    """T_cam_object of what stands there."""
    item = stored(name)
    return WHERE @ similarity(item.half_extent, translation=item.center)


def edges_and_shape(name="ell"):
    frame = photograph({1: in_camera(MESHES[name](), WHERE)})
    return mask_edges(frame, 1, CONFIG), stored(name).shape.vertices.astype(np.float64)


def test_the_true_shape_reaches_as_far_as_its_mask_to_within_a_pixel():
    edges, vertices = edges_and_shape()
    gap, _ = edges.gaps(truth("ell"), vertices, WHERE[:3, 3])
    assert len(gap) == CONFIG.by_mask.directions
    assert np.abs(gap).max() < 1


def test_the_rows_tell_how_far_small_motions_move_the_reach():
    edges, vertices = edges_and_shape()
    middle = WHERE[:3, 3]
    gap, rows = edges.gaps(truth("ell"), vertices, middle)
    step = 1e-6
    for axis in range(6):
        motion = np.eye(4)
        if axis < 3:
            turn = np.zeros(3)
            turn[axis] = step
            motion[:3, :3] += np.cross(turn, np.eye(3)).T
            motion[:3, 3] = middle - motion[:3, :3] @ middle
        else:
            motion[axis - 3, 3] = step
        moved, _ = edges.gaps(motion @ truth("ell"), vertices, middle)
        np.testing.assert_allclose((gap - moved) / step, rows[:, axis], rtol=1e-3, atol=1e-2)


def test_where_another_thing_or_the_border_may_cut_the_mask_it_does_not_count():
    box = in_camera(MESHES["box"](), WHERE)
    alone = mask_edges(photograph({1: box}), 1, CONFIG)
    toward = T_WORLD_CAM[:2, 3] / np.linalg.norm(T_WORLD_CAM[:2, 3])
    T_cam_ball = placed(*(0.12 * toward), 0.0)
    frame = photograph({1: box, 2: in_camera(MESHES["ball"](), T_cam_ball)})
    beside = mask_edges(frame, 1, CONFIG)
    assert 4 < len(beside.reach) < len(alone.reach)
    far = placed(0.42, 0.0, 0.5)
    cut = mask_edges(photograph({1: in_camera(MESHES["box"](), far)}), 1, CONFIG)
    assert len(cut.reach) < len(alone.reach)


def test_edges_bring_a_shape_back_that_its_points_leave_aside():
    """A patch of the box's top tells its height, and nothing of where along it the box stands."""
    frame = photograph({1: in_camera(MESHES["box"](), WHERE)})
    points = frame.object_points(1).astype(np.float64)
    height = TABLE.signed_distance(points)
    top = np.random.default_rng(0).permutation(points[height > 0.139])[:300]
    mask = seen_mask(in_patches(frame, 1, 0.1), 1, 300, TABLE, CONFIG)
    item = stored("box")
    aside = np.eye(4)
    aside[:3, 3] = 0.003 * WHERE[:3, 0]
    ends = []
    for each in (None, mask):
        T = refine_by_rays(
            aside @ truth("box"),
            item.shape,
            top,
            float(K[0, 0]),
            TABLE,
            0.001,
            SensorConfig(),
            RayRefinementConfig(),
            mask=each,
        )
        vertices = item.shape.vertices.astype(np.float64)
        moved = transform_points(T, vertices) - transform_points(truth("box"), vertices)
        ends.append(np.linalg.norm(moved, axis=1).mean())
    assert ends[1] < 0.0012 < 0.002 < ends[0]
