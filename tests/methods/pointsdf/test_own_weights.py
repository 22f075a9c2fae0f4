"""The weights that come with the package: what they learnt from, and what they do as installed."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from table_scene import box, in_camera, photograph, placed
from tabletop.held_out import held_out_names

from brrp_cli import reconstruct
from brrp_cli.cli import main
from brrp_cli.config import PointSDFConfig
from brrp_cli.evaluation.weights import named_weights
from brrp_cli.frames.npz import save_frame
from brrp_cli.ground_truth.metrics import f_score, sample_surface
from brrp_cli.methods.pointsdf.weights import OWN_WEIGHTS, describe_weights
from brrp_cli.shapes import solids

UNSEEN_YCB = ("030_", "031_", "032_", "065-b_", "065-d_", "072-a_", "073-e_")
THINGS = {
    1: in_camera(box(), placed(-0.08, 0.0, 0.5)),
    2: in_camera(solids.cylinder(0.035, 0.11), placed(0.08, 0.02, 0.0)),
}


def test_they_are_small_enough_to_ship():
    assert OWN_WEIGHTS.stat().st_size < 10e6


def test_they_never_saw_what_evaluations_hold_back():
    names = set(describe_weights(OWN_WEIGHTS)["meshes"])
    assert len(names) > 500
    assert not names & held_out_names()
    assert not [name for name in names if name.startswith(UNSEEN_YCB)]
    random_shapes = [int(name) for name in names if name.isdigit()]
    assert random_shapes and min(random_shapes) >= 100 and max(random_shapes) < 900


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    save_frame(photograph(THINGS), folder / "frame.npz")
    (folder / "coarse.toml").write_text("[surface]\nspacing = 0.01\nnodes = 64_000\n")
    command = ["reconstruct", folder / "frame.npz", "--method", "pointsdf", "-o", folder / "out"]
    result = CliRunner().invoke(main, [*map(str, command), "--config", str(folder / "coarse.toml")])
    assert result.exit_code == 0, result.output
    return folder / "out"


@pytest.mark.parametrize("object_id", THINGS)
def test_a_box_and_a_can_are_solids_of_about_their_size_where_they_stand(out, object_id):
    """Their backs too, which no pixel shows; edges are not what such a network knows."""
    found, truth = trimesh.load(out / f"object_{object_id}.ply"), THINGS[object_id]
    assert found.is_watertight
    assert 0.7 < found.volume / truth.volume < 1.4
    assert np.linalg.norm(found.bounds.mean(axis=0) - truth.bounds.mean(axis=0)) < 0.01
    ours, true = (sample_surface(m, 4000, np.random.default_rng(0)) for m in (found, truth))
    assert f_score(ours, true, 0.02) > 0.95


def test_a_pixel_far_behind_an_object_moves_nothing():
    frame = photograph({1: THINGS[1]})
    rows, columns = np.nonzero(frame.segmap == 1)
    points = frame.points.copy()
    points[rows[0], columns[0]] *= 3
    config = PointSDFConfig()
    config = replace(config, surface=replace(config.surface, spacing=0.01, nodes=64_000))
    found, expected = (
        reconstruct(f, method="pointsdf", config=config).objects[0].surface.as_trimesh()
        for f in (replace(frame, points=points), frame)
    )
    np.testing.assert_allclose(found.bounds, expected.bounds, atol=0.004)


def test_the_record_names_them(out):
    weights = json.loads((out / "result.json").read_text())["config"]["weights"]
    assert weights["path"] == str(OWN_WEIGHTS)
    assert weights["training"]["name"] == OWN_WEIGHTS.stem


def test_evaluations_take_them_where_no_others_are_given(tmp_path):
    other = tmp_path / "other.safetensors"
    assert named_weights(["vprism", "pointsdf"], []) == {"tabletop": OWN_WEIGHTS}
    assert named_weights(["pointsdf"], [other]) == {"other": other}
    assert named_weights(["vprism"], []) == {}
