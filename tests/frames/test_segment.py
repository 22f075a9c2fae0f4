"""Segmentation of a scene whose masks are known."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.fragments import find_fragments, flying_pixels, merge_by_footprint
from brrp_cli.frames.inside import fill_inside
from brrp_cli.frames.segment import segment


def noisy(depth, seed=0):
    """Depth as a sensor gives it: noise, millimetres, and smeared edges."""
    rng = np.random.default_rng(seed)
    depth = depth + rng.normal(0, 0.0015, depth.shape) * depth**2
    smeared = depth.copy()
    smeared[:, 1:-1] = (depth[:, :-2] + 2 * depth[:, 1:-1] + depth[:, 2:]) / 4
    return (smeared * 1000).round() / 1000


def overlap(first, second):
    """Intersection over union of two masks."""
    return (first & second).sum() / (first | second).sum()


@pytest.mark.parametrize("degrade", [lambda depth: depth, noisy], ids=["clean", "noisy"])
def test_objects_on_the_table_are_found_from_left_to_right(scene, degrade):
    depth = degrade(np.where(np.isfinite(scene.depth), scene.depth, 0))
    found = segment(make_frame(scene.rgb, None, depth=depth, K=scene.K))
    assert np.unique(found).tolist() == [0, 1, 2, 3]
    for number, object_id in [(1, 7), (2, 250), (3, -3)]:
        assert overlap(found == number, scene.segmap == object_id) > 0.75, object_id


def test_the_same_seed_gives_the_same_masks(scene):
    frame = make_frame(scene.rgb, None, depth=scene.depth, K=scene.K)
    assert np.array_equal(segment(frame, 3), segment(frame, 3))


def test_the_frames_own_masks_are_not_looked_at(scene):
    frames = [make_frame(None, mask, depth=scene.depth, K=scene.K) for mask in (None, scene.segmap)]
    assert np.array_equal(segment(frames[0]), segment(frames[1]))


def test_what_stands_beside_the_table_is_background(scene):
    found = segment(make_frame(None, None, depth=scene.depth, K=scene.K))
    wall = scene.depth > 1.3
    assert wall.sum() > 100
    assert not found[wall & (scene.segmap == 0)].any()


def test_an_empty_table_and_no_table_are_told(scene):
    v, _ = np.mgrid[:120, :160]
    slope = (v - scene.K[1, 2]) / scene.K[1, 1]
    table = 0.5 / (0.7 * slope + 0.7)  # a plane that is tilted by 45 degrees
    with pytest.raises(FrameError, match="Nothing stands on the table"):
        segment(make_frame(None, None, depth=table, K=scene.K))
    clutter = np.random.default_rng(0).uniform(0.5, 5, scene.depth.shape)
    with pytest.raises(FrameError, match="No support plane"):
        segment(make_frame(None, None, depth=clutter, K=scene.K))


def test_depth_edges_are_flying_and_slopes_are_not():
    K = np.array([[100.0, 0, 10], [0, 100.0, 10], [0, 0, 1]])
    depth = np.ones((20, 20))
    depth[:, 10:] = 1.1
    assert np.unique(np.nonzero(flying_pixels(depth, K, 4.0))[1]).tolist() == [9, 10]
    ramp = 1 + 0.02 * np.arange(20.0)[:, None] + np.zeros((20, 20))
    assert not flying_pixels(ramp, K, 4.0).any()
    assert not flying_pixels(np.full((20, 20), np.nan), K, 4.0).any()


def test_thin_bridges_do_not_join_fragments():
    mask = np.zeros((20, 44), bool)
    mask[4:16, 2:18] = mask[4:16, 24:40] = True
    mask[9:11, 18:24] = True
    labels = find_fragments(mask)
    assert labels[6, 6] != labels[6, 30]
    assert (labels[mask] > 0).all()
    mask[4:16, 18:24] = True
    assert len(np.unique(find_fragments(mask)[mask])) == 1


def test_fragments_on_one_spot_are_one_object_and_neighbours_are_not():
    plan = np.stack(np.meshgrid(np.arange(60) / 500, np.arange(40) / 500), axis=-1)
    labels = np.zeros((40, 60), np.int64)
    labels[5:30, 5:25] = 1
    labels[10:20, 10:20] = 2  # seen inside the first, as a mug's inner wall is
    labels[5:30, 26:50] = 3
    merged = merge_by_footprint(labels, plan, 0.12)
    assert merged[6, 6] == merged[15, 15]
    assert merged[6, 6] != merged[6, 30]
    assert (merged[labels == 0] == 0).all()


def test_a_bowls_floor_is_filled_and_the_crook_of_a_bend_is_not():
    plan = np.stack(np.meshgrid(np.arange(100) / 500, np.arange(100) / 500), axis=-1)
    radius = np.linalg.norm(plan - 0.1, axis=-1)
    everywhere = np.ones((100, 100), bool)
    ring = ((radius > 0.06) & (radius < 0.08)).astype(np.int64) * 5
    assert fill_inside(ring, plan, everywhere)[50, 50] == 5
    assert (fill_inside(ring, plan, everywhere)[radius > 0.085] == 0).all()
    assert np.array_equal(fill_inside(ring, plan, ~everywhere), ring)
    half = np.where(plan[..., 0] < 0.1, ring, 0)
    assert fill_inside(half, plan, everywhere)[50, 49] == 0
