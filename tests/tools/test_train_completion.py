"""The command that trains the completion, on two small scenes, as people run it."""

import json
import shutil
from importlib.resources import files

import numpy as np
import pytest
import torch
from click.testing import CliRunner
from safetensors import safe_open
from tiny_scenes import write_meshes, write_scene
from train_completion import main
from training import completion_examples
from training.completion import ShapeNetworkConfig, draw_batch, scores, started
from training.completion_examples import Wanted, held_names, make_view, names_in, read_examples

from brrp_cli.completion.learned import load_shapes
from brrp_cli.completion.network import fitted
from brrp_cli.files import sha256_file
from brrp_cli.ground_truth.scenes import find_scenes

# With this seed the small images are seen by a camera that does not lose what they show, and the
# ball is kept to validate.
SMALL = ["--views", "1", "--cooling", "0", "--batch", "2", "--points", "16", "--seed", "1"]


def run(*arguments):
    result = CliRunner().invoke(main, [*map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Two scenes, and a folder with their examples."""
    folder = tmp_path_factory.mktemp("fit")
    write_meshes(folder / "shapes")
    write_scene(folder / "scenes" / "00000000", {1: ("can", 0.07, 0.0), 2: ("ball", -0.08, 0.02)})
    write_scene(folder / "scenes" / "00000001", {1: ("box", 0.0, 0.02)}, yaw=1.0)
    result = run(f"{folder / 'scenes'}:{folder}", "-o", folder / "made", *SMALL, "--examples-only")
    assert result.exit_code == 0, result.output
    return folder


def history(folder):
    records = json.loads((folder / "history.json").read_text())
    return [{k: v for k, v in record.items() if k != "seconds"} for record in records]


def examples_of(place):
    return read_examples(sorted((place / "made" / "examples").glob("*/*.npz")))


def test_examples_are_labelled_points_in_volumes(place):
    found = examples_of(place)
    assert sorted(found.names) == ["ball", "box", "can"]
    assert len(found.lengths) == len(found.places) == len(found.inside) == found.starts[-1]
    assert 0.1 < found.inside.mean() < 0.9
    assert np.isfinite(found.lengths.astype(float)).all()
    # What is inside lies in the middle of the volume, and what does not, around it.
    assert np.abs(found.places[found.inside].astype(float)).max() < 1.2


def test_examples_of_some_shapes_alone(place):
    paths = sorted((place / "made" / "examples").glob("*/*.npz"))
    every = read_examples(paths)
    assert names_in(paths) == list(every.names)
    row = every.names.index("ball")
    own = slice(every.starts[row], every.starts[row + 1])
    ball = read_examples(paths, lambda name: name == "ball")
    assert ball.names == ("ball",) and ball.starts.tolist() == [0, own.stop - own.start]
    np.testing.assert_array_equal(ball.volumes[0], every.volumes[row])
    np.testing.assert_array_equal(ball.lengths, every.lengths[own])
    np.testing.assert_array_equal(ball.places, every.places[own])
    np.testing.assert_array_equal(ball.inside, every.inside[own])


def test_it_begins_as_the_network_of_lengths(place):
    found = examples_of(place)
    network = started(ShapeNetworkConfig(), fitted(), 0).eval()
    lengths = torch.from_numpy(found.lengths[:300].astype(np.float32))
    with torch.no_grad():
        nothing = torch.zeros(len(lengths), network.config.features)
        logits = network.decide(network.scaled(lengths), nothing).numpy()
    np.testing.assert_allclose(logits, fitted().logits(lengths.numpy()), atol=1e-3)


def test_mirrored_objects_are_mirrored_whole(place):
    found = examples_of(place)
    rows, flips = np.arange(3), 0
    for seed in range(4):
        volumes, _, places, _ = draw_batch(found, rows, 8, np.random.default_rng(seed))
        rng = np.random.default_rng(seed)
        counts = np.diff(found.starts)
        drawn = found.starts[:-1][:, None] + rng.integers(counts[:, None], size=(3, 8))
        for row in rows:
            as_it_is = found.volumes[row].astype(np.float32) / 127
            place_of = found.places[drawn[row]].astype(np.float32)
            flipped = not np.array_equal(volumes[row].numpy(), as_it_is)
            flips += flipped
            if flipped:
                np.testing.assert_array_equal(volumes[row].numpy(), as_it_is[:, ::-1])
            sign = [-1, 1, 1] if flipped else [1, 1, 1]
            np.testing.assert_array_equal(places[row].numpy(), place_of * sign)
    assert 0 < flips < 12


def test_scores_of_what_is_known(place):
    found = examples_of(place)
    right = scores(np.where(found.inside, 9.0, -9.0), found)
    assert right["iou"] == 1 and right["volume"] == 1 and right["nll"] < 1e-3
    assert scores(np.zeros(len(found.inside)), found)["nll"] == pytest.approx(np.log(2))


def test_shapes_are_kept_by_name():
    names = [f"shape {i}" for i in range(400)]
    kept = held_names(names + names, 0.1, 0)
    assert 20 < len(kept) < 60 and kept < set(names)
    assert held_names(names[:50], 0.1, 0) == kept & set(names[:50])


def test_a_stretched_shape_is_kept_with_the_shape():
    names = [f"shape {i}" for i in range(100)]
    stretched = [f"{name}~{copy}" for name in names for copy in (1, 2)]
    kept = held_names(names + stretched, 0.1, 0)
    assert {name for name in kept if "~" in name} == {
        f"{name}~{copy}" for name in kept & set(names) for copy in (1, 2)
    }


def test_goes_on_from_the_weights_of_another_training(place, tmp_path):
    """After no step at all it says what they say."""
    weights = files("brrp_cli.completion") / "shapes.safetensors"
    shutil.copytree(place / "made", tmp_path / "more")
    options = ["--begin", weights, "--validation", 0.5, *SMALL, "--rate", 0.0]
    assert run("-o", tmp_path / "more", "--epochs", 1, *options).exit_code == 0
    before, after = load_shapes(weights), load_shapes(tmp_path / "more" / "shapes.safetensors")
    for name, tensor in before.state_dict().items():
        if name != "temperature":
            torch.testing.assert_close(after.state_dict()[name], tensor)
    with safe_open(tmp_path / "more" / "shapes.safetensors", framework="pt") as file:
        assert json.loads(file.metadata()["training"])["begun"] == sha256_file(weights)


def test_a_set_that_is_not_understood_is_named(tmp_path):
    result = run("scenes:.:masured", "-o", tmp_path)
    assert result.exit_code == 1 and "masured" in result.output and "measured" in result.output


def test_measured_depth_is_taken_as_it_is(place, tmp_path, monkeypatch):
    monkeypatch.setattr(completion_examples, "SENSORS", {"kinect-azure": 1.0})
    scenes = find_scenes(place / "scenes")
    seen = {}
    for measured in (True, False):
        wanted = Wanted(scenes[1], 0, place, measured)
        make_view(wanted, 1, tmp_path / f"{measured}.npz")
        seen[measured] = read_examples([tmp_path / f"{measured}.npz"])
    assert seen[True].names == seen[False].names == ("box",)
    assert not np.array_equal(seen[True].volumes, seen[False].volumes)


@pytest.mark.slow
def test_trains_and_goes_on_as_if_it_had_not_stopped(place, tmp_path):
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    for folder in (whole, parted):
        shutil.copytree(place / "made", folder)
    held = ["--validation", 0.5]
    result = run("-o", whole, "--epochs", 2, *SMALL, *held)
    assert result.exit_code == 0, result.output
    stopped = run("-o", parted, *SMALL, *held, "--minutes", 0)
    assert "the same command goes on" in stopped.output
    assert run("-o", parted, "--epochs", 1, *SMALL, *held).exit_code == 0
    assert "Going on after epoch 1" in run("-o", parted, "--epochs", 2, *SMALL, *held).output
    assert history(parted) == history(whole)
    one, two = (load_shapes(folder / "shapes.safetensors") for folder in (whole, parted))
    for a, b in zip(one.state_dict().values(), two.state_dict().values(), strict=True):
        assert torch.equal(a, b)
    refused = run("-o", parted, "--epochs", 2, *SMALL, *held, "--rate", 0.1)
    assert refused.exit_code == 1 and "holds another training" in refused.output


def test_tells_what_is_missing(tmp_path):
    result = run("-o", tmp_path / "out")
    assert result.exit_code == 1 and "There are no examples" in result.output
