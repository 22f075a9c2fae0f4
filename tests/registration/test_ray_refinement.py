"""The last step of a placement ends where the camera saw the object."""

from __future__ import annotations

import numpy as np
import pytest
from table_scene import MESHES, TABLE, K, in_camera, photograph, placed, stored

from brrp_cli.config import RayRefinementConfig, SensorConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.model import search_model
from brrp_cli.registration.ray_refinement import refine_by_rays
from brrp_cli.registration.sdf_refinement import refine_to_sdf

ID = 5
CONFIG, SENSOR = RayRefinementConfig(), SensorConfig()
WHERE = (0.0, 0.0, 0.5)


def seen(name, noise=0.001, where=WHERE):
    """Points (n, 3) of an object on the table, in random order, with noise along the rays."""
    frame = photograph({ID: in_camera(MESHES[name](), placed(*where))})
    rng = np.random.default_rng(0)
    points = rng.permutation(frame.points[frame.segmap == ID].astype(np.float64))
    return points * (1 + noise * rng.normal(size=(len(points), 1)) / points[:, 2:])


def truth(name):
    """T_cam_object of what stands there."""
    item = stored(name)
    return placed(*WHERE) @ similarity(item.half_extent, translation=item.center)


def refined(name, T, points, plane=TABLE, wave=SENSOR.wave, config=CONFIG):
    shape = stored(name).shape
    return refine_by_rays(T, shape, points, float(K[0, 0]), plane, wave, SENSOR, config)


def apart(name, T):
    """Metres between the vertices under T and under the truth, on average, whatever the turn about
    a beaker's own axis."""
    vertices = stored(name).shape.vertices[::10].astype(np.float64)
    if name == "beaker":
        vertices = np.array([[0, 0, -1.0], [0, 0, 1.0]])
    moved = transform_points(T, vertices) - transform_points(truth(name), vertices)
    return np.linalg.norm(moved, axis=1).mean()


@pytest.mark.parametrize("name", ["box", "ell", "beaker"])
@pytest.mark.parametrize("shift", [(0.002, -0.001, 0.001), (-0.001, 0.002, -0.002)])
def test_a_placement_that_is_off_ends_at_the_truth(name, shift):
    start = similarity(translation=np.array(shift)) @ truth(name)
    T = refined(name, start, seen(name))
    assert apart(name, T) < 0.0004 < apart(name, start)


@pytest.mark.parametrize("name", ["box", "ell", "beaker"])
def test_a_placement_that_has_come_to_rest_hardly_moves_when_it_is_refined_again(name):
    points = seen(name)
    T = refined(
        name, similarity(translation=np.array([0.001, -0.001, 0.001])) @ truth(name), points
    )
    again = refined(name, T, points)
    assert abs(apart(name, again) - apart(name, T)) < 0.00005


def test_a_thin_wall_stands_where_its_near_side_was_seen_and_not_its_middle():
    model = search_model(stored("beaker"))
    points = seen("beaker")
    start = truth("beaker") @ np.linalg.inv(model.T_model_object)
    by_field = np.linalg.inv(
        refine_to_sdf(np.linalg.inv(start)[None], points[:1000], model, 0.01, 10)[0]
    )
    T_cam_object = by_field @ model.T_model_object
    assert apart("beaker", T_cam_object) > 0.0005
    assert apart("beaker", refined("beaker", T_cam_object, points)) < 0.0003


def test_the_size_stays_and_the_same_points_give_the_same_placement():
    start = similarity(translation=np.array([0.001, 0, 0])) @ truth("ell")
    points = seen("ell")
    T = refined("ell", start, points)
    assert np.cbrt(np.linalg.det(T[:3, :3])) == pytest.approx(stored("ell").half_extent)
    np.testing.assert_array_equal(T, refined("ell", start, points))


def test_points_of_something_else_do_not_pull():
    points = seen("box")
    rng = np.random.default_rng(1)
    stray = points[: len(points) // 4] + rng.uniform(0.02, 0.05, (len(points) // 4, 3))
    mixed = rng.permutation(np.concatenate([points, stray]))
    assert apart("box", refined("box", truth("box"), mixed)) < 0.0005


def test_a_placement_that_would_have_to_go_far_stays():
    far = similarity(translation=np.array([0.0, 0.0, 0.012])) @ truth("box")
    loose = RayRefinementConfig(outlier=50.0, shift=1.0, turn=1.0)
    assert apart("box", refined("box", far, seen("box"), config=loose)) == apart("box", far)


def test_the_table_holds_what_is_seen_from_above_alone():
    # The top of a box says nothing of its height over the table but by the box's own.
    points = seen("box")
    height = points @ TABLE.normal + TABLE.offset
    top = points[height > 0.137]
    low = similarity(translation=0.0015 * TABLE.normal) @ truth("box")
    held = apart("box", refined("box", low, top[:5]))
    loose = apart("box", refined("box", low, top[:5], plane=None))
    assert held < loose
