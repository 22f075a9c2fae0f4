"""Observed samples against a scene whose inside, outside and below are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config import ObservationConfig
from brrp_cli.frames.build import make_frame
from brrp_cli.geometry import project, transform_points
from brrp_cli.observation.ray_samples import below_samples, observe, ray_samples
from brrp_cli.observation.support_plane import Plane, fit_plane

CONFIG = ObservationConfig()


@pytest.fixture(scope="module")
def frame(scene):
    """The scene as a frame."""
    return make_frame(
        rgb=scene.rgb,
        segmap=scene.segmap,
        depth=scene.depth,
        K=scene.K,
        T_world_cam=scene.T_world_cam,
    )


@pytest.fixture(scope="module")
def observation(frame):
    """What is observed of it."""
    return observe(frame, CONFIG, seed=1)


def test_the_plane_is_the_table_with_the_objects_above(frame, observation):
    world = np.array([[0.0, 0, 0.1], [0.2, -0.1, -0.05], [0, 0, 0]])
    camera = transform_points(np.linalg.inv(frame.T_world_cam), world)
    assert observation.plane.signed_distance(camera) == pytest.approx([0.1, -0.05, 0], abs=1e-4)


def test_every_object_is_observed_by_its_id(observation):
    assert list(observation.objects) == [-3, 7, 250]
    assert observation.too_few == {}


@pytest.mark.parametrize("object_id", [-3, 7, 250])
def test_points_and_center_are_those_of_the_mask(frame, observation, object_id):
    seen = observation.objects[object_id]
    points = frame.points[frame.segmap == object_id]
    assert np.array_equal(seen.points, points)
    assert seen.center == pytest.approx((points.min(axis=0) + points.max(axis=0)) / 2)
    assert seen.samples.dtype == np.float32
    assert len(seen.samples) == len(seen.labels)


@pytest.mark.parametrize("object_id", [-3, 7, 250])
def test_occupied_samples_lie_on_the_objects_own_surface(scene, observation, object_id):
    seen = observation.objects[object_id]
    occupied = seen.samples[seen.labels]
    assert len(occupied) > 20
    nearest = np.linalg.norm(occupied[:, None] - seen.points[None], axis=-1).min(axis=1)
    assert nearest.max() < CONFIG.surface_cell
    spread = np.linalg.norm(occupied[:, None] - occupied[None], axis=-1)
    assert np.median(np.where(spread > 0, spread, 9).min(axis=1)) > CONFIG.surface_cell / 3


@pytest.mark.parametrize("object_id", [-3, 7, 250])
def test_free_samples_are_not_in_the_object_and_near_it(scene, observation, object_id):
    seen = observation.objects[object_id]
    free = seen.samples[~seen.labels]
    assert len(free) > 1000
    # A free sample is the mean of a cell, and so may lie a cell's part behind a convex surface.
    inside = scene.inside(free) == object_id
    assert inside.mean() < 0.002
    assert (np.linalg.norm(free - seen.center, axis=1) < CONFIG.ray_radius + CONFIG.free_cell).all()


def test_rays_stop_at_the_surface(scene, frame):
    centers = np.array([frame.object_points(i).mean(axis=0) for i in (7, 250, -3)], np.float64)
    rays = ray_samples(frame.points[frame.valid], centers, CONFIG, seed=0)
    near = np.linalg.norm(rays[:, None] - centers[None], axis=-1).min(axis=1)
    assert near.max() < CONFIG.ray_radius + 1e-6
    # Each sample lies on the ray of a pixel, in front of that pixel's depth.
    pixel = project(rays.astype(np.float64), scene.K)
    u, v = np.rint(pixel).astype(int).T
    assert np.abs(pixel - np.stack([u, v], axis=1)).max() < 0.01
    assert (rays[:, 2] <= scene.depth[v, u] + 1e-5).all()
    assert (scene.inside(rays) != 0).mean() < 1e-3


def test_each_bin_of_each_ray_gets_one_uniform_draw():
    points = np.tile(np.array([[0.0, 0.0, 1.1]], np.float32), (4000, 1))
    wide = replace(CONFIG, ray_radius=5.0)
    depth = ray_samples(points, np.array([[0.0, 0, 1.0]]), wide, seed=0)[:, 2]
    counts, _ = np.histogram(depth, bins=[0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.1, 9])
    assert counts.tolist() == [4000] * 6 + [0]
    for low, high in [(0, 0.2), (0.4, 0.6), (1.0, 1.1)]:
        inside = depth[(depth >= low) & (depth < high)]
        assert inside.mean() == pytest.approx((low + high) / 2, abs=0.02 * (high - low))
        assert inside.std() == pytest.approx((high - low) / 12**0.5, rel=0.05)


def test_ray_samples_are_capped_by_a_fair_subset(frame):
    centers = np.array([frame.object_points(7).mean(axis=0)], np.float64)
    points = frame.points[frame.valid]
    full = ray_samples(points, centers, CONFIG, seed=0)
    capped = ray_samples(points, centers, replace(CONFIG, max_ray_samples=500), seed=0)
    assert len(capped) == 500
    assert {tuple(p) for p in capped.tolist()} <= {tuple(p) for p in full.tolist()}
    assert capped.mean(axis=0) == pytest.approx(full.mean(axis=0), abs=0.02)


def test_draws_below_the_plane_fill_the_ball_evenly():
    plane = Plane(np.array([0.0, -1.0, 0.0]), 0.5)  # y down: below is y > 0.5
    draws = below_samples(np.array([0.1, 0.5, 1.0]), plane, CONFIG, 0, 3)
    offset = draws - np.array([0.1, 0.5, 1.0])
    assert (draws[:, 1] > 0.5 - 1e-6).all()
    assert len(draws) == pytest.approx(CONFIG.below_draws / 2, rel=0.03)
    radius = np.linalg.norm(offset, axis=1)
    assert radius.max() <= CONFIG.below_radius + 1e-6
    assert (radius < 0.1).mean() == pytest.approx(1 / 8, rel=0.1)


def test_free_samples_reach_below_the_table_and_are_free(observation):
    for seen in observation.objects.values():
        height = observation.plane.signed_distance(seen.samples)
        below = height < -0.02
        assert below.sum() > 500
        assert not seen.labels[below].any()


def test_other_objects_surfaces_are_free(frame, observation):
    can = frame.object_points(250)
    seen = observation.objects[7]
    occupied, free = seen.samples[seen.labels], seen.samples[~seen.labels]
    box_to_can = np.linalg.norm(can[:, None] - seen.center, axis=-1).min()
    assert box_to_can < CONFIG.ray_radius
    near = can[np.linalg.norm(can - seen.center, axis=1) < CONFIG.ray_radius - 0.01]
    gap = np.linalg.norm(near[:, None] - free[None], axis=-1).min(axis=1)
    assert gap.max() < 2 * CONFIG.surface_cell
    assert np.linalg.norm(can[:, None] - occupied[None], axis=-1).min() > 0.02


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(frame, observation):
    again, other = observe(frame, CONFIG, seed=1), observe(frame, CONFIG, seed=2)
    for object_id, seen in observation.objects.items():
        assert seen.samples.tobytes() == again.objects[object_id].samples.tobytes()
        assert seen.samples.tobytes() != other.objects[object_id].samples.tobytes()


def test_objects_with_too_few_points_are_counted_apart(scene):
    mask = scene.segmap.copy()
    depth = scene.depth.copy()
    depth[mask == 250] = np.nan
    mask[0, 0] = 9
    observation = observe(make_frame(rgb=scene.rgb, segmap=mask, depth=depth, K=scene.K), CONFIG, 0)
    assert observation.too_few == {250: 0, 9: 1}
    assert list(observation.objects) == [-3, 7]


def test_a_frame_of_unseen_objects_alone_is_observed_as_nothing(scene):
    mask = np.zeros_like(scene.segmap)
    mask[0, 0] = 5
    observation = observe(make_frame(segmap=mask, depth=scene.depth, K=scene.K), CONFIG, 0)
    assert observation.plane is None
    assert (observation.objects, observation.too_few) == ({}, {5: 1})


def test_without_background_there_is_no_plane_and_nothing_below(scene, caplog):
    depth = np.where(scene.segmap == 0, np.nan, scene.depth)
    observation = observe(make_frame(segmap=scene.segmap, depth=depth, K=scene.K), CONFIG, 0)
    assert observation.plane is None
    assert "No support plane" in caplog.text
    world = transform_points(scene.T_world_cam, observation.objects[7].samples)
    assert world[:, 2].min() > -CONFIG.free_cell


def test_the_plane_is_found_among_outliers_and_turned_to_the_camera():
    """Wherever the scene's centre is: masks that hold the floor beyond the table pull it down."""
    rng = np.random.default_rng(0)
    plane = np.column_stack([rng.uniform(-0.3, 0.3, (3000, 2)), rng.normal(2.0, 0.002, 3000)])
    clutter = np.array([0, 0, 2]) + rng.uniform(-0.5, 0.5, (2000, 3))
    points = np.concatenate([plane, clutter])
    for side in (-0.05, 0.05):
        found = fit_plane(points, CONFIG, 0, np.array([0, 0, 2 + side]))
        assert found.normal == pytest.approx([0, 0, -1], abs=0.01)
        assert found.offset == pytest.approx(2.0, abs=1e-3)


def test_points_far_from_the_scene_do_not_make_the_plane():
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(-3, 3, (9000, 2)), np.full(9000, 3.0)])
    table = np.column_stack([rng.uniform(-0.3, 0.3, (900, 2)), np.full(900, 2.0)])
    found = fit_plane(np.concatenate([floor, table]), CONFIG, 0, np.array([0, 0, 1.95]))
    assert found.offset == pytest.approx(2.0, abs=1e-6)


def test_the_plane_does_not_depend_on_which_thread_is_first():
    rng = np.random.default_rng(0)
    plane = np.column_stack([rng.uniform(-0.4, 0.4, (3000, 2)), rng.normal(2.0, 0.006, 3000)])
    found = [fit_plane(plane, CONFIG, 0, np.array([0, 0, 1.9])) for _ in range(20)]
    assert len({(plane.normal.tobytes(), plane.offset) for plane in found}) == 1
