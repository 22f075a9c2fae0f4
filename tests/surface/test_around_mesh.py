"""The region within reach of a placed mesh holds what lies within reach of it, and no more."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from table_scene import placed, stored

from brrp_cli.config import SurfaceConfig
from brrp_cli.config.grasping import GraspConfig
from brrp_cli.geometry import similarity
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.raycast import inside
from brrp_cli.surface.around_mesh import around_axes, beyond_reach, marching_cubes_of

CONFIG = SurfaceConfig(around_nodes=400_000)


def shape_of(name):
    """As it stands on the table of the scene."""
    item = stored(name)
    T = placed(0.0, 0.0, 0.5) @ similarity(item.half_extent, translation=item.center)
    return PlacedShape(name, item.shape, T, 0.001, 5.0, np.zeros((6, 6)))


def region(shape, reach, config=CONFIG):
    reach = np.broadcast_to(reach, len(shape.vertices))
    axes = around_axes(shape, float(reach.max()), config)
    return trimesh.Trimesh(
        *marching_cubes_of(-beyond_reach(shape, reach, axes, 0.0), axes), process=False
    )


@pytest.mark.parametrize(("name", "reach"), [("box", 0.001), ("beaker", 0.0025)])
def test_it_is_closed_and_ends_at_the_reach(name, reach):
    shape = shape_of(name)
    found = region(shape, reach)
    assert found.is_watertight and found.volume > 0
    distance = shape.signed_distance(np.asarray(found.vertices), 0.01)
    assert np.abs(distance - reach).max() < 0.0006
    assert np.abs(distance - reach).mean() < 0.0001


@pytest.mark.parametrize("name", ["beaker", "ell"])
def test_the_shape_moved_by_less_lies_inside(name):
    # Moved vertices would leave out the beaker's floor, where its walls are nearer than the reach.
    shape = shape_of(name)
    found = region(shape, 0.0025)
    for seed in range(3):
        way = np.random.default_rng(seed).normal(size=3)
        moved = shape.vertices[::20] + 0.002 * way / np.linalg.norm(way)
        assert inside(found, moved).all()


def test_each_vertex_has_a_reach_of_its_own():
    shape = shape_of("box")
    high = shape.vertices @ placed(0, 0, 0)[:3, 2]
    top = high > high.mean()
    found = region(shape, np.where(top, 0.004, 0.001))
    distance = shape.signed_distance(np.asarray(found.vertices), 0.01)
    height = np.asarray(found.vertices) @ placed(0, 0, 0)[:3, 2]
    assert distance[height > high.max() - 0.01].max() == pytest.approx(0.004, abs=0.0006)
    assert distance[height < high.min() + 0.01].max() == pytest.approx(0.001, abs=0.0006)


@pytest.mark.parametrize("name", ["box", "ell"])
def test_the_coarser_grid_of_grasps_still_holds_the_shape(name):
    shape = shape_of(name)
    coarse = SurfaceConfig(around_nodes=GraspConfig().neighbour_nodes)
    found = region(shape, 0.0015, coarse)
    assert inside(found, shape.vertices).all()
    distance = shape.signed_distance(np.asarray(found.vertices), 0.01)
    assert distance.mean() == pytest.approx(0.0015, abs=0.0002)
