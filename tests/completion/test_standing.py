"""Things whose feet are hidden: they stand all the same, on the table or on one another."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.special import expit, logit
from small_prior import SMALL, write_meshes
from table_scene import T_WORLD_CAM, TABLE, in_camera, photograph, placed

from brrp_cli import Reconstructor
from brrp_cli.completion.standing import on_others, standing
from brrp_cli.completion.visible_part import visible_part
from brrp_cli.config import CompletionConfig, FeatureConfig, StandingConfig, preset
from brrp_cli.prior.build.build import build_prior
from brrp_cli.shapes import solids

CONFIG = StandingConfig()
LEVEL = 0.01
# Of the camera, along the table.
TOWARD = T_WORLD_CAM[:2, 3] / np.linalg.norm(T_WORLD_CAM[:2, 3])
YAW = float(np.arctan2(TOWARD[1], TOWARD[0]))
THING, OTHER = 1, 2


def raised(probabilities, heights, config=CONFIG):
    found = standing(logit(np.array(probabilities)), np.array(heights), LEVEL, config)
    return expit(found)


class TestGivenThatItStands:
    def test_the_most_probable_place_of_a_height_is_filled_and_others_in_proportion(self):
        found = raised([0.95, 0.4, 0.2, 0.1], [0.035, 0.015, 0.015, 0.015])
        assert found == pytest.approx([0.95, 0.8, 0.4, 0.2])

    def test_a_thin_neck_is_filled_as_surely_as_the_foot_below_it_is(self):
        # The foot is there with 0.7, so the object reaches down past its neck with 0.7 at least.
        found = raised([0.35, 0.7], [0.025, 0.015])
        assert found == pytest.approx([0.4, 0.8])

    def test_nothing_becomes_less_probable(self):
        heights = np.repeat(np.arange(1, 9) * LEVEL, 50)
        before = np.random.default_rng(0).uniform(0.01, 0.99, len(heights))
        assert (raised(before, heights) >= before - 1e-9).all()

    def test_what_reaches_down_for_sure_stays_as_it_is(self):
        before = [0.95, 0.92, 0.3, 0.81]
        assert raised(before, [0.035, 0.025, 0.025, 0.015]) == pytest.approx(before)

    def test_beneath_the_first_level_nothing_changes(self):
        found = raised([0.3, 0.2, 0.2], [0.015, 0.005, -0.02])
        assert found == pytest.approx([0.8, 0.2, 0.2])

    def test_what_the_network_takes_for_held_up_is_left_in_the_air(self):
        before = [0.95, 0.6, 0.15]
        assert raised(before, [0.035, 0.025, 0.015]) == pytest.approx(before)

    def test_nodes_under_the_plane_alone_are_let_be(self):
        assert raised([0.4], [-0.01]) == pytest.approx([0.4])


def ball(radius):
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return solids.moved(sphere, z=radius)


def screen(ahead, height):
    """A board that stands between the camera and the table's middle, so far from that."""
    x, y = TOWARD * ahead
    return in_camera(solids.box(0.02, 0.4, height), placed(x, y, YAW))


def on_table(mesh):
    return in_camera(mesh, placed(0.0, 0.0, YAW))


def stands_on_others(things):
    frame = photograph(things)
    seen = frame.object_points(THING)
    part = visible_part(seen, frame, THING, TABLE, CompletionConfig())
    return on_others(part, CONFIG)


class TestOnOthers:
    def test_a_thing_alone(self):
        assert not stands_on_others({THING: on_table(ball(0.05))})

    def test_a_thing_on_a_box(self):
        box = solids.box(0.14, 0.14, 0.06)
        lifted = solids.moved(solids.cylinder(0.04, 0.08), z=0.06)
        assert stands_on_others({THING: on_table(lifted), OTHER: on_table(box)})

    def test_a_thing_behind_a_board_that_hides_its_lower_half(self):
        assert not stands_on_others({THING: on_table(ball(0.12)), OTHER: screen(0.2, 0.2)})

    def test_a_thing_that_touches_another_one_beside_it(self):
        beside = solids.moved(solids.box(0.05, 0.05, 0.05), y=0.07)
        box = solids.box(0.08, 0.08, 0.1)
        assert not stands_on_others({THING: on_table(box), OTHER: on_table(beside)})


@pytest.fixture(scope="module")
def prior(tmp_path_factory):
    folder, parameters = tmp_path_factory.mktemp("prior"), replace(SMALL, features=FeatureConfig())
    build_prior(write_meshes(folder / "meshes"), folder / "prior", parameters, workers=1)
    return folder / "prior"


def lowest(prior, standing_config):
    """Metres over the table, of the mesh of a ball behind a board."""
    config = preset("default")
    mean = replace(config.hypotheses.mean, standing=standing_config)
    config = replace(config, hypotheses=replace(config.hypotheses, mean=mean))
    frame = photograph({THING: on_table(ball(0.12)), OTHER: screen(0.2, 0.2)})
    with Reconstructor(prior, config=config, retriever="appearance", helpers=0) as session:
        thing, _ = session(frame).objects
    return float(TABLE.signed_distance(thing.surface.vertices.astype(np.float64)).min())


def test_a_ball_whose_lower_part_is_hidden_stands_on_the_table(prior):
    assert lowest(prior, StandingConfig(enabled=False)) > 0.015
    assert abs(lowest(prior, CONFIG)) < 0.008
