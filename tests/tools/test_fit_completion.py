"""The network of completion is fitted by a command, on scenes."""

import numpy as np
import pytest
from click.testing import CliRunner
from fit_completion import Examples, fit, look, main
from tiny_scenes import write_meshes, write_scene

from brrp_cli.completion.network import from_bytes
from brrp_cli.completion.point_features import COUNT
from brrp_cli.ground_truth.scenes import find_scenes


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fit")
    write_meshes(folder / "shapes")
    for number in range(3):
        objects = {1: ("can", 0.07, 0.0), 2: ("ball", -0.08, 0.02)}
        write_scene(folder / "scenes" / f"{number:08d}", objects, yaw=float(number))
    return folder


def examples(count, seed):
    """Inside where the first length is below the third."""
    x = np.random.default_rng(seed).normal(size=(count, COUNT)).astype(np.float32)
    return Examples(x, x[:, 0] < x[:, 2])


@pytest.mark.slow
def test_what_can_be_learned_is_learned_and_a_seed_gives_one_network():
    train, held = examples(20_000, 0), examples(4_000, 1)
    network = fit(train, held, 20, 0)
    found = network.logits(held.point_features) > 0
    assert (found == held.inside).mean() > 0.95
    assert fit(train, held, 20, 0).as_bytes() == network.as_bytes()


def test_points_in_a_scene_are_told_from_those_outside(data):
    scene = find_scenes(data / "scenes")[0]
    both = look(scene, data, (), 1, 0)
    assert both.point_features.shape == (len(both.inside), COUNT)
    assert np.isfinite(both.point_features).all()
    assert 0.1 < both.inside.mean() < 0.9
    assert len(look(scene, data, ("can",), 1, 0).inside) > 0
    assert len(look(scene, data, ("mug",), 1, 0).inside) == 0


def test_the_command_writes_a_network(data, tmp_path):
    output = tmp_path / "weights.npz"
    arguments = [f"{data / 'scenes'}:{data}", "--views", "1", "--epochs", "1", "--workers", "1"]
    result = CliRunner().invoke(main, [*arguments, "-o", str(output)])
    assert result.exit_code == 0, result.output
    assert from_bytes(output.read_bytes()).middle.shape == (COUNT,)
