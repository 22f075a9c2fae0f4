"""Large objects: kin may be off by more millimetres, for walls that nobody saw."""

from dataclasses import replace

import numpy as np
import pytest
from table_scene import in_camera, photograph, placed

from brrp_cli import open_prior, reconstruct
from brrp_cli.config import preset
from brrp_cli.kin.lengths import LENGTHS, for_size
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters
from brrp_cli.shapes import solids

CONFIG = preset("default")
KIN = CONFIG.hypotheses.kin
WALL = 0.008


def cube(diagonal):
    """Points of a cube, but for the few at its corners that count as strays."""
    return np.random.default_rng(0).uniform(0, diagonal / np.sqrt(3), (100_000, 3))


def test_the_lengths_stay_up_to_the_usual_size():
    assert for_size(KIN, cube(0.9 * KIN.usual)) is KIN


def test_they_grow_with_the_object():
    larger = for_size(KIN, cube(2 * KIN.usual))
    for name in LENGTHS:
        assert getattr(larger, name) == pytest.approx(2 * getattr(KIN, name), rel=0.05)


def test_costs_are_as_before_but_for_walls_that_were_not_seen():
    closed, wall, opened = KIN.most_cost
    larger = for_size(KIN, cube(2 * KIN.usual)).most_cost
    # Costs are of squares: a quarter for lengths that are twice as long.
    assert larger == pytest.approx((closed / 4, wall, opened / 4), rel=0.1)
    # What is looked into is no harder to fit than what is not.
    assert for_size(KIN, cube(9 * KIN.usual)).most_cost[2] == wall


def pot(radii, height):
    """Revolved: radii at equal steps of its height, with a wall and a bottom."""
    r, z = np.array(radii), np.linspace(0, height, len(radii))
    outside = np.column_stack([r, z])
    inside = np.column_stack([r - WALL, z])[:0:-1]
    bottom = [(r[0] - WALL, WALL), (0, WALL)]
    return solids.revolve(np.concatenate([[(0, 0)], outside, inside, bottom]))


@pytest.fixture(scope="module")
def pots(tmp_path_factory):
    meshes = tmp_path_factory.mktemp("pot_meshes")
    pot([0.05, 0.10, 0.115, 0.10, 0.06, 0.07], 0.24).export(meshes / "pot.ply")
    solids.box(0.10, 0.06, 0.14).export(meshes / "box.ply")
    out = tmp_path_factory.mktemp("pot_prior") / "prior"
    looks = AppearanceConfig(views=8, rays=500)
    parameters = BuildParameters(samples=500, dense_points=5000, appearance=looks)
    build_prior(meshes, out, parameters, workers=1)
    return open_prior(out)


def of_usual(usual):
    kin = replace(KIN, usual=usual)
    return replace(CONFIG, hypotheses=replace(CONFIG.hypotheses, kin=kin))


def test_a_pot_on_its_mouth_is_like_one_of_another_profile(pots):
    height = 0.28
    truth = pot([0.06, 0.11, 0.125, 0.09, 0.05, 0.065], height)
    upside_down = solids.moved(truth.apply_transform(np.diag([1.0, -1, -1, 1])), z=height)
    frame = photograph({5: in_camera(upside_down, placed(0.0, 0.0, 2.27))})
    item = reconstruct(frame, pots, config=CONFIG).objects[0]
    assert item.recognised is None and item.like.name == "pot"
    assert item.surface.as_trimesh().volume == pytest.approx(truth.volume, rel=0.2)
    without = reconstruct(frame, pots, config=of_usual(10.0)).objects[0]
    assert without.like is None
