"""The shape that fills in for an unknown object: closed, on the plane, as large as what is seen."""

from __future__ import annotations

import numpy as np
import pytest
from table_scene import TABLE, box, in_camera, photograph, placed

from brrp_cli.config import VisibleShapeConfig
from brrp_cli.frames.plane import Plane
from brrp_cli.geometry import transform_points
from brrp_cli.inference.visible_shape import hull_facets, roof_over, visible_shape
from brrp_cli.registration.starts import plane_frame
from brrp_cli.shapes import solids

CONFIG = VisibleShapeConfig()
FLOOR = Plane(np.array([0.0, 0.0, 1.0]), 0.0)


def seen(mesh, T_cam_mesh):
    frame = photograph({5: in_camera(mesh, T_cam_mesh)})
    return frame.object_points(5)


def iou(shape, T_cam_mesh, contains, half, count=20_000):
    """Of a shape with what `contains` says in the mesh's frame, twice as far out, half as high
    again."""
    local = np.random.default_rng(0).uniform(-1, 1, (count, 3)) * half * [2, 2, 3]
    local[:, 2] = np.abs(local[:, 2])
    found = shape.signed_distance(transform_points(T_cam_mesh, local)) < 0
    true = contains(local)
    return (found & true).sum() / (found | true).sum()


def in_box(points):
    return (np.abs(points - [0, 0, 0.07]) < [0.05, 0.03, 0.07]).all(axis=1)


def in_can(points):
    return (np.hypot(*points[:, :2].T) < 0.04) & (points[:, 2] < 0.12)


@pytest.mark.parametrize("yaw", [0.1, 0.8, 2.0])
def test_of_a_box_seen_from_above_at_an_angle_most_is_right(yaw):
    T = placed(0.02, -0.03, yaw)
    shape = visible_shape(seen(box(), T), TABLE, CONFIG)
    assert iou(shape, T, in_box, np.array([0.05, 0.03, 0.07])) > 0.75


def test_of_a_can_seen_from_above_at_an_angle_most_is_right():
    T = placed(-0.02, 0.03, 0.0)
    shape = visible_shape(seen(solids.cylinder(0.04, 0.12), T), TABLE, CONFIG)
    assert iou(shape, T, in_can, np.array([0.04, 0.04, 0.06])) > 0.75


def test_the_shape_stands_on_the_plane_and_does_not_stick_out_at_the_top():
    T = placed(0.02, -0.03, 0.8)
    points = seen(box(), T)
    shape = visible_shape(points, TABLE, CONFIG)
    foot, top, over, under = transform_points(
        T, np.array([[0, 0, 0.005], [0, 0, 0.135], [0, 0, 0.15], [0, 0, -0.01]])
    )
    found = shape.signed_distance(np.stack([foot, top, over, under]))
    assert (found[:2] < 0).all() and (found[2:] > 0).all()
    np.testing.assert_allclose(TABLE.signed_distance(shape.feet), 0, atol=1e-9)
    assert len(shape.extent) == len(shape.seen) + len(shape.feet)


def test_what_was_seen_lies_in_its_surface():
    """Of a box: within the growth, and the roof's cells."""
    points = seen(box(), placed(0.02, -0.03, 0.8)).astype(np.float64)
    distance = visible_shape(points, TABLE, CONFIG).signed_distance(points)
    assert distance.max() < CONFIG.cell
    assert distance.min() > -CONFIG.growth - 2 * CONFIG.cell


def test_it_is_drawn_in_far_from_what_was_seen():
    """Behind a patch that faces the camera nothing is known: a cone, not a prism."""
    T = placed(0.0, 0.0, 0.4)
    points = seen(box(), T)
    narrow = visible_shape(points, None, CONFIG)
    wide = visible_shape(points, None, VisibleShapeConfig(shrink=0.0))
    probes = np.random.default_rng(0).uniform(points.min(axis=0), points.max(axis=0), (9000, 3))
    inside, both = wide.signed_distance(probes) < 0, narrow.signed_distance(probes) < 0
    assert (both <= inside).all() and both.sum() < inside.sum()


def test_hollows_under_a_seen_roof_are_filled_and_space_beside_it_is_not():
    """Two posts of 10 cm, 10 cm apart: their hull spans the gap, but nothing was seen over it."""
    line = np.linspace(0, 0.02, 11)
    square = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    posts = np.concatenate(
        [np.column_stack([square + [x, 0], np.full(len(square), 0.1)]) for x in (0.0, 0.12)]
    )
    shape = visible_shape(posts, FLOOR, CONFIG)
    in_post, in_gap = np.array([[0.01, 0.01, 0.05]]), np.array([[0.07, 0.01, 0.05]])
    assert shape.signed_distance(in_post)[0] < 0
    assert shape.signed_distance(in_gap)[0] > 0.02
    hull = hull_facets(np.concatenate([shape.seen, shape.feet]))
    assert (in_gap @ hull[:, :3].T + hull[:, 3] < 0).all(), "the hull alone would hold it"


def test_the_roof_is_the_greatest_height_over_each_cell():
    rng = np.random.default_rng(0)
    flat = rng.uniform(0, 0.06, (6000, 2))
    height = np.where(flat[:, 0] < 0.03, 0.05, 0.02)
    points = np.column_stack([flat, height])
    roof = roof_over(points, FLOOR, CONFIG)
    probes = np.array([[0.01, 0.03, 0.1], [0.05, 0.03, 0.1], [0.05, 0.03, 0.01], [0.5, 0.5, 0.1]])
    np.testing.assert_allclose(roof.above(probes), [0.05, 0.08, -0.01, 1.1], atol=1e-9)
    T = plane_frame(FLOOR)
    np.testing.assert_allclose(transform_points(T, probes)[:, 2], probes[:, 2], atol=1e-12)


def test_the_facets_of_a_box_are_its_six_sides_outward():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float)
    facets = hull_facets(corners)
    assert len(facets) == 6
    assert (corners @ facets[:, :3].T + facets[:, 3] < 1e-9).all()
    assert (np.array([0.5, 1, 1.5]) @ facets[:, :3].T + facets[:, 3] < 0).all()
    np.testing.assert_allclose(np.linalg.norm(facets[:, :3], axis=1), 1, atol=1e-6)


def grid(count):
    line = np.linspace(-0.03, 0.03, count)
    x, y = np.meshgrid(line, line)
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.8)])


@pytest.mark.parametrize("plane", [None, Plane(np.array([0.0, -1.0, 0.0]), 0.05)])
@pytest.mark.parametrize(
    "points",
    [
        grid(15),
        np.array([[0, 0, 0.8], [0.03, 0, 0.8], [0, 0.02, 0.8]]),
        np.linspace([0, 0, 0.8], [0.1, 0, 0.8], 40),
        np.array([[0.01, 0.0, 0.8]]),
    ],
    ids=["plane", "triangle", "line", "point"],
)
def test_flat_clouds_have_a_shape_too(points, plane):
    shape = visible_shape(points, plane, CONFIG)
    assert shape.signed_distance(points).max() < CONFIG.cell
    far = np.array([[0.0, 0.0, 1.2], [0.3, 0.0, 0.8]])
    assert (shape.signed_distance(far) > 0.1).all()


def test_without_a_plane_there_are_no_feet_and_no_roof():
    points = seen(box(), placed(0.02, -0.03, 0.8))
    shape = visible_shape(points, None, CONFIG)
    assert shape.roof is None and shape.feet.shape == (0, 3)
    assert (shape.signed_distance(points.mean(axis=0)[None]) < 0.01).all()
    np.testing.assert_array_equal(shape.extent, shape.seen)
