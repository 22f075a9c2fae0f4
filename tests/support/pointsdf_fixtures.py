"""What several tests share: examples of one scene, and networks that have learnt them."""

from __future__ import annotations

import os
import pickle
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from eight_objects import NETWORK, write_scenes
from filelock import FileLock
from training.examples import Examples, Recipe, scene_examples

from brrp_cli.ground_truth.scenes import Scene, find_scenes

# By heart, and enough to give each of them a surface.
STEPS, FEW_STEPS, RATE = 350, 30, 1e-2


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
    """Eight objects; `fresh` asks of the same clouds at other points. This and what follows is made
    once for all workers of a run."""
    base = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent
    folder = base / "pointsdf"
    made = folder / "examples.pickle"
    with FileLock(base / "pointsdf.lock"):
        if not made.is_file():
            scene, *_ = write_scenes(folder, 2)
            examples = [
                scene_examples(
                    scene,
                    folder,
                    Recipe("exact", NETWORK.points, queries=4096, seed=seed),
                    folder / "cache",
                )
                for seed in (0, 1)
            ]
            made.write_bytes(pickle.dumps(examples))
    one, other = pickle.loads(made.read_bytes())
    return Place(folder, find_scenes(folder / "scenes"), one, other, folder / "eight.safetensors")


@pytest.fixture(scope="session")
def trained(place) -> Place:
    """The same after a short training."""
    train(place, FEW_STEPS)
    return place


@pytest.fixture(scope="session")
def learnt(place) -> Place:
    """The same after a training that has learnt the eight by heart, which takes long."""
    found = replace(place, weights=place.folder / "by_heart" / place.weights.name)
    found.weights.parent.mkdir(exist_ok=True)
    train(found, STEPS)
    return found


def train(place: Place, steps: int) -> None:
    """All of the eight in every step, unless it was done already."""
    with FileLock(place.weights.with_suffix(".lock")):
        if not place.weights.is_file():
            _train(place, steps)


def _train(place: Place, steps: int) -> None:
    from training.pointsdf import Training, TrainingConfig

    from brrp_cli.methods.pointsdf.weights import save_weights

    config = TrainingConfig(batch=8, queries=512, noise=0.0, rate=RATE)
    about = {"name": "eight"}
    training = Training(NETWORK, config, place.folder, place.weights, about)
    eight = np.arange(8)
    for number in range(steps):
        # Falling to 0, so that few steps suffice.
        training.optimizer.param_groups[0]["lr"] = RATE * (1 - number / steps)
        training.step(training.drawn(place.examples, eight, number), number)
    training.settle(place.examples, [eight] * 16)
    save_weights(training.network, about, place.weights, half=True)
