import json

import pytest
import torch
from eight_objects import NETWORK
from safetensors.torch import load_file, save_file

from brrp_cli.errors import WeightsError
from brrp_cli.methods.pointsdf.network import PointSDF
from brrp_cli.methods.pointsdf.weights import FORMAT, describe_weights, load_weights, save_weights

TRAINING = {"name": "two boxes", "objects": 2}


@pytest.fixture
def network():
    torch.manual_seed(0)
    return PointSDF(NETWORK).eval()


@pytest.fixture
def path(network, tmp_path):
    save_weights(network, TRAINING, tmp_path / "weights.safetensors")
    return tmp_path / "weights.safetensors"


def answers(network):
    return network(torch.linspace(-1, 1, 2 * 64 * 3).reshape(2, 64, 3), torch.ones(2, 5, 3))


def test_a_network_comes_back_as_it_went(network, path):
    loaded = load_weights(path)
    assert loaded.training == TRAINING == describe_weights(path)
    assert loaded.network.config == NETWORK and not loaded.network.training
    torch.testing.assert_close(answers(loaded.network), answers(network), rtol=0, atol=0)


def test_half_precision_halves_the_file_and_hardly_changes_the_answer(network, path, tmp_path):
    half = tmp_path / "half.safetensors"
    save_weights(network, TRAINING, half, half=True)
    assert half.stat().st_size < 0.6 * path.stat().st_size
    torch.testing.assert_close(
        answers(load_weights(half).network), answers(network), rtol=0.01, atol=0.01
    )


def test_what_is_missing_is_told(tmp_path):
    with pytest.raises(WeightsError, match="no weights there") as error:
        load_weights(tmp_path / "none.safetensors")
    assert "none.safetensors" in str(error.value) and "train_pointsdf" in str(error.value)
    with pytest.raises(WeightsError, match="a folder"):
        load_weights(tmp_path)


def test_other_files_are_refused(network, path, tmp_path):
    foreign = tmp_path / "foreign.safetensors"
    save_file(load_file(path), foreign)
    with pytest.raises(WeightsError, match="not of this network"):
        load_weights(foreign)
    pickled = tmp_path / "pointsdf.pt"
    torch.save(network.state_dict(), pickled)
    with pytest.raises(WeightsError, match="cannot be read"):
        load_weights(pickled)


def test_every_cut_is_noticed(path):
    data = path.read_bytes()
    for share in (0.0, 0.001, 0.1, 0.5, 0.999):
        path.write_bytes(data[: int(share * len(data))])
        with pytest.raises(WeightsError):
            load_weights(path)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda t: t.pop("encoder.code.0.weight"), "encoder.code.0.weight"),
        (lambda t: t.update(extra=torch.zeros(1)), "extra"),
        (lambda t: t["decoder.out.bias"].fill_(torch.nan), "decoder.out.bias is not finite"),
        (lambda t: t.update({"decoder.out.bias": torch.zeros(2)}), "decoder.out.bias"),
    ],
)
def test_tensors_that_do_not_fit_are_named(path, change, found):
    tensors = load_file(path)
    change(tensors)
    metadata = {"format": FORMAT, "network": network_of(path), "training": json.dumps(TRAINING)}
    save_file(tensors, path, metadata=metadata)
    with pytest.raises(WeightsError, match="cannot be read") as error:
        load_weights(path)
    assert found in str(error.value)


def network_of(path):
    from safetensors import safe_open

    with safe_open(path, framework="pt") as file:
        return file.metadata()["network"]


def test_a_bad_description_is_told(path):
    metadata = {"format": FORMAT, "network": "{}", "training": "{}"}
    save_file(load_file(path), path, metadata=metadata)
    with pytest.raises(WeightsError, match="cannot be read"):
        describe_weights(path)
