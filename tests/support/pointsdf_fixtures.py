"""What several tests share: examples of one scene, and a network that has learnt them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from shutil import copyfile

import numpy as np
import pytest
from eight_objects import NETWORK, write_scenes
from filelock import FileLock
from training.examples import Examples, Recipe, scene_examples

from brrp_cli.ground_truth.scenes import Scene

STEPS, RATE = 350, 1e-2


@dataclass(frozen=True)
class Place:
    """A folder with scenes, what was made of the first, and the weights that it was learnt to."""

    folder: Path
    scenes: list[Scene]
    examples: Examples
    fresh: Examples
    weights: Path


@pytest.fixture(scope="session")
def place(tmp_path_factory) -> Place:
    """Eight objects; `fresh` asks of the same clouds at other points."""
    folder = tmp_path_factory.mktemp("pointsdf")
    scenes = write_scenes(folder, 2)
    one, other = (
        scene_examples(
            scenes[0],
            folder,
            Recipe("exact", NETWORK.points, queries=4096, seed=seed),
            folder / "cache",
        )
        for seed in (0, 1)
    )
    return Place(folder, scenes, one, other, folder / "eight.safetensors")


@pytest.fixture(scope="session")
def learnt(place, tmp_path_factory) -> Place:
    """The same after a training that has learnt the eight by heart, once for all workers."""
    shared = place.weights
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = tmp_path_factory.getbasetemp().parent / place.weights.name
    with FileLock(shared.with_suffix(".lock")):
        if not shared.is_file():
            train(place)
            if shared != place.weights:
                place.weights.rename(shared)
    if shared != place.weights:
        copyfile(shared, place.weights)
    return place


def train(place: Place) -> None:
    """All of the eight in every step."""
    from training.pointsdf import Training, TrainingConfig

    from brrp_cli.methods.pointsdf.weights import save_weights

    config = TrainingConfig(batch=8, queries=512, noise=0.0, learning_rate=RATE)
    about = {"name": "eight"}
    training = Training(NETWORK, config, place.folder, place.weights, about)
    eight = np.arange(8)
    for number in range(STEPS):
        # Falling to 0, so that few steps suffice.
        training.optimizer.param_groups[0]["lr"] = RATE * (1 - number / STEPS)
        training.step(place.examples, eight, number)
    training.settle(place.examples, [eight] * 16)
    save_weights(training.network, about, place.weights, half=True)
