"""The command that trains the network of masks, on two small scenes, as people run it."""

import json
import shutil

import numpy as np
import pytest
import torch
from click.testing import CliRunner
from tiny_scenes import write_meshes, write_scene
from train_masks import main
from training import mask_batches
from training.affinity_file import load_weights, save_affinity_network
from training.affinity_network import AffinityNetworkConfig
from training.mask_batches import draw_batch
from training.mask_examples import Examples, is_held, read_examples
from training.masks import loss_of, resumed, started

from brrp_cli.errors import BrrpError, WeightsError
from brrp_cli.segmentation.image_channels import CHANNELS, SIDEWAYS
from brrp_cli.segmentation.pixel_pairs import OFFSETS, windows

# With this seed one of both scenes is kept to validate.
SMALL = ["--views", 1, "--cooling", 0, "--batch", 1, "--workers", 1, "--seed", 3]
HELD = ["--validation", 0.5]


def run(*arguments):
    result = CliRunner().invoke(main, [*map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Scenes, and a folder with their examples."""
    folder = tmp_path_factory.mktemp("masks")
    write_meshes(folder / "shapes")
    for number in range(3):
        write_scene(
            folder / "scenes" / f"{number:08d}",
            {1: ("can", 0.07, 0.0), 2: ("ball", -0.08, 0.02)},
            yaw=float(number),
        )
    scenes = f"{folder / 'scenes'}:measured"
    result = run(scenes, "-o", folder / "made", *SMALL, "--examples-only")
    assert result.exit_code == 0, result.output
    return folder


def examples_of(place):
    return read_examples(sorted((place / "made" / "examples").glob("*/*.npz")))


def history(folder):
    records = json.loads((folder / "history.json").read_text())
    return [{k: v for k, v in record.items() if k != "seconds"} for record in records]


def test_examples_have_the_true_labels(place):
    found = examples_of(place)
    assert len(found) == 3
    assert np.unique(found.labels).tolist() == [0, 1, 2]
    height = found.channels[:, 3]
    assert height[found.labels > 0].mean() > 10 > 2 > abs(np.median(height[found.labels == 0]))


def test_views_of_two_sizes_are_told(place, tmp_path):
    first = next((place / "made" / "examples").glob("*/*.npz"))
    np.savez(tmp_path / "b.npz", channels=np.zeros((CHANNELS, 4, 5)), labels=np.zeros((4, 5)))
    np.savez(tmp_path / "c.npz", channels=np.zeros((CHANNELS, 0, 0)), labels=np.zeros((0, 0)))
    with pytest.raises(BrrpError, match="two sizes"):
        read_examples([first, tmp_path / "b.npz"])
    assert len(read_examples([first, tmp_path / "c.npz"])) == 1


def test_the_loss_is_nothing_where_all_is_right_and_one_pair_too_many_costs():
    labels = torch.ones(1, 32, 40, dtype=torch.int64)
    labels[:, :, 20:] = 2
    labels[:, :4] = 0
    logits = torch.zeros(1, len(OFFSETS) + 1, 32, 40)
    logits[0, -1] = torch.where(labels[0] > 0, 20.0, -20.0)
    for index, offset in enumerate(OFFSETS):
        pixel, partner = windows(offset, (32, 40))
        same = labels[0][pixel] == labels[0][partner]
        logits[0, index][pixel] = torch.where(same, 20.0, -20.0)
    assert float(loss_of(logits, labels)) < 1e-6
    # What is said of the table itself is not asked for.
    other = logits.clone()
    other[0, 0, :3] *= -1
    assert float(loss_of(other, labels)) < 1e-6
    other[0, 0, 10, 19] *= -1
    assert float(loss_of(other, labels)) > 1e-3


def test_batches_turn_labels_with_their_images():
    labels = np.zeros((1, 64, 64), np.uint8)
    labels[:, 10:30, 5:20] = 3
    channels = np.zeros((1, CHANNELS, 64, 64), np.int8)
    channels[:, 3][labels > 0] = 63
    channels[:, SIDEWAYS][labels > 0] = 63
    examples = Examples(channels, labels, ("one",))
    signs = set()
    for seed in range(8):
        found, asked = draw_batch(examples, np.array([0]), (48, 48), np.random.default_rng(seed))
        assert asked.shape == (1, 48, 48) and set(np.unique(asked)) <= {0, 3}
        seen = found[0, 3] > 0
        assert not (seen & (asked[0] == 0)).any()  # holes alone differ
        signs |= set(np.sign(found[0, SIDEWAYS][seen].numpy()))
        assert float(found[0, :3].abs().max()) <= 1
    assert signs == {-1.0, 1.0}


def test_normals_turn_with_an_image_that_is_turned(monkeypatch):
    labels = np.zeros((1, 96, 96), np.uint8)
    labels[:, :, 48:] = 1
    channels = np.zeros((1, CHANNELS, 96, 96), np.int8)
    channels[:, SIDEWAYS] = 63  # toward what is masked
    monkeypatch.setattr(mask_batches, "TURNED", 1.0)
    examples = Examples(channels, labels, ("one",))
    beyond = 0
    for seed in range(8):
        found, asked = draw_batch(examples, np.array([0]), (64, 64), np.random.default_rng(seed))
        normals, shown = found[0, SIDEWAYS : SIDEWAYS + 2].numpy(), asked[0].numpy() > 0
        seen = np.abs(normals).max(axis=0) > 0
        beyond += int((~seen).sum())
        places = np.indices(seen.shape)[::-1]  # to the right, and down
        apart = places[:, shown].mean(axis=1) - places[:, seen & ~shown].mean(axis=1)
        normal = normals[:, seen].mean(axis=1)
        assert apart @ normal > 0.97 * np.linalg.norm(apart) * np.linalg.norm(normal)
    assert beyond > 0


def test_a_network_begins_with_what_it_has_in_common_with_an_earlier_one(tmp_path):
    given = started(AffinityNetworkConfig((16, 16, 32, 48, 72, 96)), 1)
    path = tmp_path / "earlier.onnx"
    save_affinity_network(given, {}, path)
    begun, fresh = resumed(path, 0).state_dict(), started(AffinityNetworkConfig(), 0).state_dict()
    same = [name for name, each in given.state_dict().items() if each.shape == fresh[name].shape]
    assert 0 < len(same) < len(fresh)
    for name, weights in begun.items():
        want = given.state_dict()[name].half().float() if name in same else fresh[name]
        assert torch.equal(weights, want), name
    with pytest.raises(WeightsError, match="network that parts objects cannot be read"):
        resumed(tmp_path / "none.onnx", 0)


def test_views_of_a_scene_are_kept_together(tmp_path):
    paths = [
        tmp_path / "set" / f"{scene:08d}_{view}.npz" for scene in range(300) for view in (0, 1)
    ]
    held = [is_held(path, 0.1, 0) for path in paths]
    assert held[::2] == held[1::2] and 10 < sum(held) / 2 < 60


def test_trains_and_goes_on_as_if_it_had_not_stopped(place, tmp_path):
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    for folder in (whole, parted):
        shutil.copytree(place / "made", folder)
    result = run("-o", whole, "--epochs", 2, *SMALL, *HELD)
    assert result.exit_code == 0, result.output
    assert "the same command goes on" in run("-o", parted, *SMALL, *HELD, "--minutes", 0).output
    assert run("-o", parted, "--epochs", 1, *SMALL, *HELD).exit_code == 0
    assert "Going on after epoch 1" in run("-o", parted, "--epochs", 2, *SMALL, *HELD).output
    assert history(parted) == history(whole)
    one, two = (load_weights(f / "affinities.onnx") for f in (whole, parted))
    for a, b in zip(one.values(), two.values(), strict=True):
        assert torch.equal(a, b)
    refused = run("-o", parted, "--epochs", 2, *SMALL, *HELD, "--rate", 0.1)
    assert refused.exit_code == 1 and "holds another training" in refused.output


def test_products_in_bfloat16_teach_about_the_same(place, tmp_path):
    losses = []
    for precision in ("float32", "bfloat16"):
        folder = tmp_path / precision
        shutil.copytree(place / "made", folder)
        result = run("-o", folder, "--epochs", 1, *SMALL, *HELD, "--precision", precision)
        assert result.exit_code == 0, result.output
        losses.append(history(folder)[0]["held_loss"])
        weights = torch.load(folder / "best.pt", weights_only=True)
        assert {each.dtype for each in weights.values()} == {torch.float32}
    assert losses[0] != losses[1]
    assert losses[1] == pytest.approx(losses[0], rel=0.05)


def test_tells_what_is_missing_and_what_is_not_understood(tmp_path):
    result = run("-o", tmp_path / "out")
    assert result.exit_code == 1 and "too little to train on" in result.output
    result = run("scenes:masured", "-o", tmp_path)
    assert result.exit_code == 1 and "masured" in result.output and "measured" in result.output
