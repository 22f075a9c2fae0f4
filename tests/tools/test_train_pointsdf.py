"""The training command on two small scenes, as people run it."""

import json

import pytest
from click.testing import CliRunner
from eight_objects import MESHES, write_scenes
from train_pointsdf import main

from brrp_cli.methods.pointsdf.weights import load_weights

SMALL = ["--width", "0.02", "--queries", "32", "--batch", "4", "--truth", "exact", "--every", "1"]


def run(*arguments):
    result = CliRunner().invoke(main, [*map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("training")
    write_scenes(folder, 2)
    return folder


def history(folder):
    records = json.loads((folder / "history.json").read_text())
    return [{k: v for k, v in record.items() if k != "seconds"} for record in records]


@pytest.mark.slow
def test_trains_and_goes_on_and_says_what_it_was_trained_on(place, tmp_path):
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    result = run(place / "scenes", "--data-root", place, "-o", whole, "--epochs", 2, *SMALL)
    assert result.exit_code == 0, result.output
    found = load_weights(whole / "whole.safetensors").training
    assert found["name"] == "whole" and found["scenes"] == 2 and found["objects"] == 8
    assert found["meshes"] == sorted(MESHES) and found["config"]["queries"] == 32

    # No time at all: the examples are made, and the training stops before its first step.
    stop = [place / "scenes", "--data-root", place, "-o", parted, *SMALL, "--minutes", 0]
    result = run(*stop)
    assert result.exit_code == 0 and "the same command goes on" in result.output
    # Without the scenes, from what was kept of them.
    assert run("-o", parted, "--epochs", 1, *SMALL).exit_code == 0
    result = run("-o", parted, "--epochs", 2, *SMALL)
    assert "Going on after epoch 1" in result.output
    assert history(parted) == history(whole)


def test_tells_what_is_missing(tmp_path):
    result = run("-o", tmp_path / "out")
    assert result.exit_code == 1 and "Two scenes at least" in result.output
    result = run(tmp_path, "-o", tmp_path / "out")
    assert result.exit_code == 1 and "No scene found" in result.output
    result = run(tmp_path / "a" / "scenes", tmp_path / "b" / "scenes", "-o", tmp_path / "out")
    assert result.exit_code == 1 and "Two folders of scenes have one name" in result.output
