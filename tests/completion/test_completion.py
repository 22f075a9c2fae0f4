"""An object that no stored one explains: closed, on the plane, as large as what is seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import TABLE, box, completed_grid, in_camera, photograph, placed, surface_seen

from brrp_cli.completion.completed_mean import empty_space, network_grid
from brrp_cli.completion.learned import LearnedShape, shapes
from brrp_cli.completion.network import Network, fitted, from_bytes
from brrp_cli.completion.point_features import COUNT, point_features
from brrp_cli.completion.visible_part import visible_part
from brrp_cli.config import CompletionConfig, MeanConfig
from brrp_cli.frames.projection import at_pixels
from brrp_cli.geometry import transform_points
from brrp_cli.inference.mean_grid import MeanGrid, grid_over
from brrp_cli.observation.support_plane import Plane
from brrp_cli.shapes import solids

CONFIG, MEAN = CompletionConfig(), MeanConfig()


def photographed(mesh, T_cam_mesh):
    return photograph({5: in_camera(mesh, T_cam_mesh)})


def part_of(frame, plane=TABLE, points=None, config=CONFIG):
    points = frame.object_points(5) if points is None else points
    return visible_part(points, frame, 5, plane, config)


def completed(frame, config=MEAN, margin=0.05):
    """The grid's nodes, their logits, and which are seen to be empty."""
    part = part_of(frame)
    extent = part.extent
    box = np.stack([extent.min(axis=0) - margin, extent.max(axis=0) + margin])
    lower, spacing, nodes = grid_over(box, config.nodes)
    empty = empty_space(nodes.reshape(-1, 3), frame, 5, TABLE, config).reshape(nodes.shape[:3])
    logits = completed_grid(nodes, empty, part, surface_seen(frame, 5), config)
    return nodes, MeanGrid(lower, spacing, logits, -config.limit), empty


def inside(frame, points):
    """What is occupied, more likely than not."""
    return completed(frame)[1].logits(points) > 0


def iou(frame, T_cam_mesh, contains, half, count=20_000):
    """With what `contains` says in the mesh's frame, twice as far out, half as high again."""
    local = np.random.default_rng(0).uniform(-1, 1, (count, 3)) * half * [2, 2, 3]
    local[:, 2] = np.abs(local[:, 2])
    found, true = inside(frame, transform_points(T_cam_mesh, local)), contains(local)
    return (found & true).sum() / (found | true).sum()


def in_box(points):
    return (np.abs(points - [0, 0, 0.07]) < [0.05, 0.03, 0.07]).all(axis=1)


def in_can(points):
    return (np.hypot(*points[:, :2].T) < 0.04) & (points[:, 2] < 0.12)


@pytest.mark.parametrize("yaw", [0.1, 0.8, 2.0])
def test_of_a_box_seen_from_above_at_an_angle_most_is_right(yaw):
    T = placed(0.02, -0.03, yaw)
    assert iou(photographed(box(), T), T, in_box, np.array([0.05, 0.03, 0.07])) > 0.75


def test_of_a_can_seen_from_above_at_an_angle_most_is_right():
    T = placed(-0.02, 0.03, 0.0)
    mesh = solids.cylinder(0.04, 0.12)
    assert iou(photographed(mesh, T), T, in_can, np.array([0.04, 0.04, 0.06])) > 0.8


def test_it_stands_on_the_plane_and_does_not_stick_out_at_the_top():
    T = placed(0.02, -0.03, 0.8)
    foot, top, over, under = transform_points(
        T, np.array([[0, 0, 0.01], [0, 0, 0.13], [0, 0, 0.155], [0, 0, -0.01]])
    )
    found = inside(photographed(box(), T), np.stack([foot, top, over, under]))
    np.testing.assert_array_equal(found, [True, True, False, False])


def test_a_cup_that_is_looked_into_stays_hollow():
    T = placed(0.0, 0.0, 0.0)
    frame = photographed(solids.beaker(0.04, 0.04, 0.06, 0.004), T)
    assert not inside(frame, transform_points(T, np.array([[0, 0, 0.04]])))[0]


def test_what_is_seen_has_some_thickness_whatever_the_network_says():
    """And no more in front: the surface is where it was seen."""
    frame = photographed(solids.beaker(0.04, 0.04, 0.06, 0.004), placed(0.0, 0.0, 0.0))
    nodes, mean, empty = completed(frame)
    thinks = network_grid(nodes, empty, part_of(frame), MEAN)[~empty]
    points, found = nodes[~empty], mean.values.astype(float)[~empty]
    surface = surface_seen(frame, 5)
    behind = surface.behind(points) * at_pixels(points, surface.across, frame)
    thickness = max(MEAN.shell, MEAN.shell_nodes * mean.spacing)
    own = at_pixels(points, frame.segmap, frame) == 5
    wall = own & (behind > MEAN.ramp.width) & (behind < thickness - surface.nearer)
    wall &= TABLE.signed_distance(points) > 0
    assert (thinks[wall] < 0).any()
    assert (found[wall] >= MEAN.shell_logit).all()
    front = own & (at_pixels(points, surface.sure, frame) == 1) & (behind < -0.0001)
    assert (thinks[front] > 0).any()
    assert (found[front] < 0).all()
    elsewhere = ~(own & (behind < thickness))
    np.testing.assert_allclose(
        found[elsewhere], thinks[elsewhere].clip(-MEAN.limit, MEAN.limit), atol=0.005
    )


@pytest.mark.parametrize(("nodes", "learned"), [(20_000, False), (60_000, False), (20_000, True)])
def test_the_lattice_is_the_networks_where_it_counts(nodes, learned):
    frame = photographed(box(), placed(0.0, 0.0, 0.3))
    config = replace(MEAN, nodes=nodes)
    part = part_of(frame, config=replace(CONFIG, learned=learned, largest=1.0))
    extent = part.extent
    around = np.stack([extent.min(axis=0) - 0.01, extent.max(axis=0) + 0.01])
    _, _, at = grid_over(around, config.nodes)
    # Along x the last node is asked first, along y it lies beyond the last that is.
    at = at[: (at.shape[0] - 1) // 2 * 2 + 1, : at.shape[1] // 2 * 2]
    every = at.reshape(-1, 3)
    if learned:
        exact = LearnedShape(part, part.config.volume, shapes()).logits(every)
    else:
        exact = fitted().logits(point_features(every, part))
    exact = exact.reshape(at.shape[:3])
    nothing, everything = np.zeros(at.shape[:3], bool), np.ones(at.shape[:3], bool)
    found = network_grid(at, nothing, part, config).clip(-config.limit, config.limit)
    # A node on the edge of a pixel may fall on either side.
    near = np.abs(found - exact.clip(-config.limit, config.limit)) < 0.01
    assert near[::2, ::2, ::2].mean() > 0.99
    doubtful = np.abs(exact) < 1
    assert doubtful.sum() > 200
    assert near[doubtful].mean() > 0.99 and ((found > 0) == (exact > 0)).mean() > 0.998
    assert not near.all(), "not all nodes are asked"
    surface = surface_seen(part.frame, 5)
    assert (completed_grid(at, everything, part, surface, config) == -config.limit).all()


def test_a_part_has_the_extents_of_what_is_seen():
    T = placed(0.0, 0.0, 0.0)
    frame = photographed(box(), T)
    part = part_of(frame)
    assert part.top == pytest.approx(0.14, abs=0.01)
    assert part.width == pytest.approx(0.10, abs=0.012)
    np.testing.assert_allclose(TABLE.signed_distance(part.feet), 0, atol=1e-9)
    assert len(part.extent) == len(part.seen) + len(part.feet)
    # A box is convex: what is seen of it lies in its hull's surface.
    assert np.quantile(part.depths, 0.9) < 0.004


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
def test_flat_clouds_have_finite_lengths_and_are_empty_far_away(points, plane):
    frame = photographed(box(), placed(0.0, 0.0, 0.3))
    part = part_of(frame, plane, points)
    probes = np.concatenate([points, [[0.0, 0.0, 1.2], [0.3, 0.0, 0.8]]])
    found = point_features(probes, part)
    assert found.shape == (len(probes), COUNT)
    assert np.isfinite(found).all()
    assert (fitted().logits(found)[-2:] < 0).all()


def test_lengths_do_not_depend_on_other_points():
    frame = photographed(box(), placed(0.02, -0.03, 0.8))
    part = part_of(frame)
    points = frame.object_points(5)[:50].astype(np.float64) + [0, 0, 0.02]
    np.testing.assert_array_equal(
        point_features(points, part)[7:8], point_features(points[7:8], part)
    )


def network():
    """max(0, x1 - x2) - 1 of inputs that are first moved by one and halved."""
    return Network(
        np.array([1, 1], np.float32),
        np.array([2, 2], np.float32),
        (
            (np.array([[1], [-1]], np.float32), np.zeros(1, np.float32)),
            (np.ones((1, 1), np.float32), np.array([-1], np.float32)),
        ),
    )


def test_a_network_of_known_weights():
    x = np.array([[5, 1], [1, 5], [3, 3]], np.float32)
    np.testing.assert_allclose(network().logits(x), [1, -1, -1])


def test_a_network_comes_back_from_its_bytes():
    x = np.random.default_rng(0).normal(size=(20, 2)).astype(np.float32)
    again = from_bytes(network().as_bytes())
    np.testing.assert_array_equal(again.logits(x), network().logits(x))


def test_the_network_of_the_package_takes_the_lengths():
    assert fitted().middle.shape == (COUNT,)
