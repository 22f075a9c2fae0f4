"""Where things end, on surfaces whose shape is known."""

from __future__ import annotations

import numpy as np

from brrp_cli.config.segmentation import (
    ComponentsConfig,
    ConcaveEdgesConfig,
    SmoothDepthConfig,
)
from brrp_cli.geometry import backproject
from brrp_cli.segmentation.components import absorb_small, find_parts
from brrp_cli.segmentation.concave_edges import (
    depth_jumps,
    hollow_creases,
    surface_normals,
)
from brrp_cli.segmentation.region_growing import fill_holes
from brrp_cli.segmentation.smooth_depth import flying_pixels, smooth_depth

K = np.array([[200.0, 0, 40], [0, 200.0, 30], [0, 0, 1]])

EDGES, PARTS, SMOOTH = ConcaveEdgesConfig(), ComponentsConfig(), SmoothDepthConfig()


def roof(slope):
    """Points of a roof whose ridge (slope > 0) or valley (slope < 0) runs down the middle."""
    u = np.arange(80.0)
    depth = 1 + slope * np.abs(u - 40) / 200 + np.zeros((60, 80))
    return backproject(depth, K).astype(float)


def test_a_valley_is_a_hollow_crease_and_a_ridge_is_none():
    valley, ridge = (
        hollow_creases(p, surface_normals(p, EDGES), EDGES) for p in (roof(-1.5), roof(1.5))
    )
    assert (valley[10:50, 40] == 1).all()
    assert valley[10:50, 10:30].max() == 0
    assert ridge.max() == 0


def test_normals_look_at_the_camera():
    points = roof(0.7)
    normals = surface_normals(points, EDGES)[10:50, 10:30]
    assert (np.sum(normals * points[10:50, 10:30], axis=-1) < 0).all()
    assert np.allclose(np.linalg.norm(normals, axis=-1), 1)


def test_jumps_are_marked_on_both_sides_and_slopes_are_not():
    depth = np.ones((20, 20))
    depth[:, 10:] = 1.1
    assert np.unique(np.nonzero(depth_jumps(depth, K, EDGES))[1]).tolist() == [9, 10]
    ramp = 1 + 0.02 * np.arange(20.0)[:, None] + np.zeros((20, 20))
    assert not depth_jumps(ramp, K, EDGES).any()
    assert not depth_jumps(np.full((20, 20), np.nan), K, EDGES).any()


def test_smoothing_keeps_planes_and_edges_and_takes_noise():
    v, u = np.mgrid[:60, :80]
    plane = 1 / (1.0 + 0.002 * u + 0.001 * v)
    assert np.allclose(smooth_depth(plane, SMOOTH)[5:-5, 5:-5], plane[5:-5, 5:-5], rtol=1e-4)
    step = np.where(u < 40, 0.8, 1.2)
    assert np.allclose(smooth_depth(step, SMOOTH), step, rtol=1e-6)
    noise = np.random.default_rng(0).normal(0, 0.003, plane.shape)
    assert np.std((smooth_depth(plane + noise, SMOOTH) - plane)[5:-5, 5:-5]) < 0.003 / 3
    holed = plane.copy()
    holed[30, 40] = np.nan
    assert np.isnan(smooth_depth(holed, SMOOTH)[30, 40])
    assert np.isfinite(smooth_depth(holed, SMOOTH)).sum() == holed.size - 1


def test_pixels_between_two_surfaces_fly_and_those_of_a_slope_do_not():
    depth = np.where(np.arange(80) < 40, 0.8, 1.2) + np.zeros((60, 80))
    depth[:, 40] = 1.0
    flying = flying_pixels(depth, SMOOTH)
    assert flying[:, 40].all()
    assert not flying[:, :38].any()
    assert not flying[:, 43:].any()
    assert not flying_pixels(1 / (1 + 0.004 * np.arange(80.0)) + np.zeros((60, 80)), SMOOTH).any()


def test_parts_end_at_boundaries_and_at_necks():
    mask = np.zeros((20, 44), bool)
    mask[4:16, 2:18] = mask[4:16, 24:40] = True
    wall = np.zeros(mask.shape)
    mask[9:11, 18:24] = True
    parts = find_parts(mask, wall, PARTS)
    assert parts[6, 6] != parts[6, 30]
    assert (parts[mask] > 0).all()
    mask[4:16, 18:24] = True
    assert len(np.unique(find_parts(mask, wall, PARTS)[mask])) == 1
    wall[:, 20:22] = 1
    parts = find_parts(mask, wall, PARTS)
    assert parts[6, 6] != parts[6, 30]


def test_a_thin_thing_that_touches_another_by_a_corner_is_a_part():
    mask = np.zeros((60, 60), bool)
    mask[2:18, 2:18] = True
    line = np.zeros_like(mask)
    line[np.arange(18, 58), np.arange(18, 58)] = True
    parts = find_parts(mask | line, np.zeros(mask.shape), PARTS)
    assert len(np.unique(parts[mask])) == len(np.unique(parts[line])) == 1
    assert 0 < parts[4, 4] != parts[25, 25] > 0


def test_small_parts_join_the_neighbour_that_no_wall_parts_them_from():
    parts = np.repeat([[1] * 10 + [2] * 2 + [3] * 10], 8, axis=0)
    wall = np.zeros(parts.shape)
    wall[:, 9:11] = 1
    joined = absorb_small(parts, wall, np.array([False, False, True, False]))
    assert np.unique(joined).tolist() == [1, 3]
    assert (joined[:, 10:12] == 3).all()


def test_holes_in_one_thing_are_filled_and_those_between_two_are_not():
    labels = np.ones((20, 40), np.int64)
    labels[:, 20:] = 2
    missing = np.zeros(labels.shape, bool)
    for rows, columns in ((slice(5, 9), slice(5, 9)), (slice(5, 9), slice(18, 23))):
        missing[rows, columns] = True
    missing[0:3, 30:33] = True
    filled = fill_holes(np.where(missing, 0, labels), missing)
    assert (filled[5:9, 5:9] == 1).all()
    assert (filled[5:9, 18:23] == 0).all()
    assert (filled[0:3, 30:33] == 0).all()
