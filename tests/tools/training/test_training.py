import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from eight_objects import NETWORK
from training.checkpoint import CHECKPOINT, HISTORY, cooled
from training.pointsdf import (
    Training,
    TrainingConfig,
    draw_batch,
    evaluate,
    narrowed,
    split,
)

from brrp_cli.errors import BrrpError
from brrp_cli.methods.pointsdf.network import NetworkConfig
from brrp_cli.methods.pointsdf.weights import load_weights

# Two epochs of four steps; dropout is on, so that its random numbers count too.
SMALL = replace(NETWORK, features=((8,), (8,), (8,), (8,)), hidden=16, dropout=0.2)
CONFIG = TrainingConfig(epochs=2, batch=2, queries=32)


def training(folder, config=CONFIG, about=None):
    return Training(SMALL, config, folder, folder / "small.safetensors", about or {})


def losses(folder, examples, config=CONFIG, **options):
    """Of each step, and the history without its times."""
    return run(training(folder, config), examples, **options)


def run(work, examples, **options):
    found = []
    work.run(examples, examples, stepped=found.append, **options)
    return found, history(work.folder)


def history(folder):
    records = json.loads((folder / HISTORY).read_text())
    return [{k: v for k, v in record.items() if k != "seconds"} for record in records]


@pytest.fixture(scope="module")
def whole(place, tmp_path_factory):
    """The folder, the losses and the history of a training that nobody stopped."""
    folder = tmp_path_factory.mktemp("training") / "whole"
    return folder, *losses(folder, place.examples)


class KilledError(Exception):
    pass


@pytest.mark.parametrize("dies_after", [1, 3, 4, 6])
def test_a_killed_training_goes_on_to_the_same_losses(place, whole, tmp_path, dies_after):
    _, expected, epochs = whole
    assert len(expected) == 8 and len(set(expected)) == 8

    seen = []

    def die(loss):
        seen.append(loss)
        if len(seen) == dies_after:
            raise KilledError

    # What a kill leaves: the last checkpoint, here after every second step, and nothing later.
    with pytest.raises(KilledError):
        training(tmp_path / "killed").run(place.examples, place.examples, every=2, stepped=die)
    again, resumed = losses(tmp_path / "killed", place.examples, every=2)
    assert again == expected[len(expected) - len(again) :]
    assert seen == expected[:dies_after]
    assert len(again) <= 8 - dies_after + 2, "it went on and did not begin anew"
    assert resumed == epochs


def test_a_stopped_training_goes_on_and_may_become_longer(place, tmp_path):
    longer = replace(CONFIG, epochs=3)
    expected, epochs = losses(tmp_path / "whole", place.examples, longer)
    steps = iter([True] * 3 + [False])
    first = training(tmp_path / "stopped")
    assert not first.run(place.examples, place.examples, go_on=lambda: next(steps))
    assert losses(tmp_path / "stopped", place.examples)[0] == expected[3:8]
    assert losses(tmp_path / "stopped", place.examples, longer) == (expected[8:], epochs)


def test_the_rate_falls_over_the_last_epochs_alone():
    assert [cooled(epoch, 10, 4) for epoch in (0, 5.9, 6)] == [1, 1, 1]
    falling = [cooled(epoch, 10, 4) for epoch in np.linspace(6, 10, 9)]
    assert falling == sorted(falling, reverse=True)
    assert cooled(8, 10, 4) == pytest.approx(0.5) and cooled(10, 10, 4) == pytest.approx(0)
    assert [cooled(epoch, 10, 0) for epoch in (0, 9.9, 10)] == [1, 1, 1]


def test_a_cooling_training_goes_on_to_the_same_losses(place, tmp_path):
    cooling = replace(CONFIG, epochs=3, cooling=2)
    expected, epochs = losses(tmp_path / "whole", place.examples, cooling)
    steps = iter([True] * 6 + [False])
    first = training(tmp_path / "stopped", cooling)
    assert not first.run(place.examples, place.examples, go_on=lambda: next(steps))
    assert losses(tmp_path / "stopped", place.examples, cooling) == (expected[6:], epochs)
    # What is cooled differs from the first cooled step on.
    steady, _ = losses(tmp_path / "steady", place.examples, replace(cooling, cooling=0))
    assert steady[:6] == expected[:6] and steady[6:] != expected[6:]


def test_the_weights_are_those_of_the_best_epoch(place, tmp_path):
    work, weights = training(tmp_path), []

    def ended(record):
        weights.append({name: t.clone() for name, t in work.network.state_dict().items()})

    _, epochs = run(work, place.examples, ended=ended)
    best = int(np.argmin([each["validation_loss"] for each in epochs]))
    found = load_weights(tmp_path / "small.safetensors")
    assert found.training["epoch"] == epochs[best]["epoch"]
    for name, tensor in found.network.state_dict().items():
        if tensor.is_floating_point():
            torch.testing.assert_close(tensor, weights[best][name].half().float(), rtol=0, atol=0)


def test_the_seed_decides(place, whole, tmp_path):
    _, one, _ = whole
    same, _ = losses(tmp_path / "same", place.examples)
    other, _ = losses(tmp_path / "other", place.examples, replace(CONFIG, seed=1))
    assert same == one != other


def test_another_training_is_not_continued(place, tmp_path):
    training(tmp_path).save()
    with pytest.raises(BrrpError, match="another training") as error:
        training(tmp_path, replace(CONFIG, noise=0.0))
    assert "training noise = 0.0" in str(error.value)
    with pytest.raises(BrrpError, match="another training"):
        training(tmp_path, about={"truth": "exact"})
    (tmp_path / CHECKPOINT).write_bytes(b"junk")
    with pytest.raises(BrrpError, match="checkpoint cannot be read"):
        training(tmp_path)


def test_a_noisy_cloud_takes_its_queries_along(place):
    """Each cloud is centred again; a query lies from its points where it lay before."""
    rows = np.arange(8)
    clouds, queries, labels = draw_batch(place.examples, rows, 4096, 0.02, np.random.default_rng(0))
    middle = (clouds.amin(dim=1) + clouds.amax(dim=1)) / 2
    np.testing.assert_allclose(middle, 0, atol=1e-6)
    moved = place.examples.clouds.astype(float) - clouds.numpy()
    shift = moved.mean(axis=1)
    assert 0.01 < moved.std(axis=1).mean() < 0.03
    # All queries of an example are drawn, in another order.
    for i in rows:
        own = np.sort(place.examples.queries[i].astype(float), axis=0)
        found = np.sort(queries[i].numpy(), axis=0)
        spread = found - own
        np.testing.assert_allclose(spread - spread.mean(axis=0), 0, atol=2e-3)
        assert np.abs(spread.mean(axis=0) + shift[i]).max() < 0.02
        assert labels[i].sum() == place.examples.labels[i].sum()


def test_scenes_are_held_out():
    names = [f"{i:03d}" for i in range(40)]
    train, held = split(names, 0.1, seed=0)
    assert len(held) == 4 and sorted(train + held) == names
    assert split(names, 0.1, seed=0) == (train, held) != split(names, 0.1, seed=1)
    assert [len(part) for part in split(["a", "b"], 0.0, seed=0)] == [1, 1]


@pytest.mark.slow
def test_eight_objects_are_learnt_by_heart(learnt):
    """And so is what lies between the points that the training asked."""
    network = load_weights(learnt.weights).network
    assert evaluate(network, learnt.examples, 8, "cpu")["validation_iou"] > 0.9
    assert evaluate(network, learnt.fresh, 8, "cpu")["validation_iou"] > 0.87


def test_settled_statistics_answer_as_the_training_did(place, tmp_path):
    """Without noise and dropout, on one batch, nothing else tells the two apart."""
    config = replace(CONFIG, queries=4096, noise=0.0)
    work = Training(replace(SMALL, dropout=0.0), config, tmp_path, tmp_path / "w.safetensors", {})
    rows = np.arange(8)
    for number in range(3):
        work.step(work.drawn(place.examples, rows, number), number)
    lagging = evaluate(work.network, place.examples, 8, "cpu")["validation_loss"]
    work.settle(place.examples, [rows])
    settled = evaluate(work.network, place.examples, 8, "cpu")["validation_loss"]
    trained = work.step(work.drawn(place.examples, rows, 3), 3)
    # A cloud's middle is 0 up to half precision, and is moved there when it is drawn.
    assert settled == pytest.approx(trained, rel=0.01)
    assert abs(settled - trained) < 0.2 * abs(lagging - trained)


def test_a_narrowed_network_has_fewer_features_and_the_same_codes():
    config = NetworkConfig()
    half = narrowed(config, 0.5)
    assert half.features[-1] == (128, 128, 256) and half.hidden == 256
    assert replace(half, features=config.features, hidden=config.hidden) == config
