"""The completion that has learned shapes: as it comes with the package, and as a file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from safetensors.torch import save_file
from table_scene import TABLE, ball, completed_grid, in_camera, photograph, placed, surface_seen

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.completion.learned import LearnedShape, load_shapes, save_shapes
from brrp_cli.completion.shape_network import ShapeNetwork, ShapeNetworkConfig
from brrp_cli.completion.visible_part import visible_part
from brrp_cli.config import preset
from brrp_cli.errors import WeightsError
from brrp_cli.inference.mean_grid import grid_over
from brrp_cli.surface.extract import level_set

HYPOTHESES = preset("default").hypotheses
CONFIG = replace(HYPOTHESES.completion, learned=True)
TINY = ShapeNetworkConfig(features=4, widths=(4, 8, 8), hidden=8)


def part():
    frame = photograph({5: in_camera(ball(), placed(0.0, 0.0, 0.0))})
    return visible_part(frame.object_points(5), frame, 5, TABLE, CONFIG)


def tiny(seed=0):
    torch.manual_seed(seed)
    return ShapeNetwork(TINY).eval().requires_grad_(False)


def test_what_is_written_is_read_in_half_precision(tmp_path):
    network, path = tiny(), tmp_path / "shapes.safetensors"
    save_shapes(network, {"objects": 3}, path)
    seen, rng = part(), np.random.default_rng(0)
    points = seen.seen[:200] + rng.normal(0, 0.02, (200, 3))
    logits = LearnedShape(seen, CONFIG.volume, network).logits(points)
    again = LearnedShape(seen, CONFIG.volume, load_shapes(path)).logits(points)
    assert np.ptp(logits) > 0.01, "it depends on the point"
    np.testing.assert_allclose(again, logits, atol=0.02)
    assert len(LearnedShape(seen, CONFIG.volume, network).logits(np.empty((0, 3)))) == 0


def test_the_volume_counts():
    """Of two volumes and the same lengths, other logits: the features reach the point."""
    network, rng = tiny(), np.random.default_rng(0)
    volumes = torch.from_numpy(rng.uniform(-1, 1, (2, 8, 40, 40, 40)).astype(np.float32))
    places = torch.from_numpy(rng.uniform(-1, 1, (2, 50, 3)).astype(np.float32))
    found = network.at(network.encode(volumes), places)
    assert found.shape == (2, 50, TINY.features)
    logits = network.decide(torch.zeros(2, 50, TINY.lengths), found)
    assert (logits[0] - logits[1]).abs().max() > 1e-3


def test_a_place_has_the_features_of_its_own_voxels():
    network = tiny()
    features = torch.zeros(1, 1, 20, 20, 20)
    features[0, 0, 3, 10, 17] = 1.0  # along across, ahead, up
    place = (torch.tensor([3, 10, 17]) + 0.5) / 10 - 1
    others = place.flip(0), place + 0.1
    found = network.at(features, torch.stack([place, *others])[None])[0, :, 0]
    np.testing.assert_allclose(found.numpy(), [1, 0, 0], atol=1e-5)


@pytest.mark.parametrize("bad", ["nothing", "no weights", "another format"])
def test_a_file_that_cannot_be_used_is_named(tmp_path, bad):
    path = tmp_path / "shapes.safetensors"
    if bad == "no weights":
        path.write_bytes(b"\x00" * 100)
    elif bad == "another format":
        save_file({"x": torch.zeros(2)}, path, metadata={"format": "brrp pointsdf 1"})
    with pytest.raises(WeightsError, match="weights of the completion cannot be read") as raised:
        load_shapes(path)
    assert str(path) in str(raised.value)


def test_the_ball_of_which_a_half_is_seen_is_whole_and_comes_out_the_same_twice():
    seen, mean = part(), HYPOTHESES.mean
    box = np.stack([seen.extent.min(axis=0) - 0.03, seen.extent.max(axis=0) + 0.03])
    lower, spacing, nodes = grid_over(box, 40_000)
    empty = empty_space(nodes.reshape(-1, 3), seen.frame, 5, TABLE, mean).reshape(nodes.shape[:3])
    depth = surface_seen(seen.frame, 5)
    logits, again = (completed_grid(nodes, empty, seen, depth, mean) for _ in range(2))
    assert logits.tobytes() == again.tobytes()
    occupancy = 1 / (1 + np.exp(-logits.astype(np.float64)))
    axes = tuple(lower[i] + spacing * np.arange(nodes.shape[i]) for i in range(3))
    surface = level_set(occupancy, axes, seen.seen, 0.5, preset("default").surface)
    mesh = trimesh.Trimesh(surface.vertices, surface.faces)
    assert mesh.is_volume and mesh.body_count == 1
    assert 0.8 < mesh.volume / ball().volume < 1.25
    true = in_camera(ball(), placed(0.0, 0.0, 0.0))
    centre = true.vertices.mean(axis=0)
    assert abs(np.linalg.norm(mesh.vertices - centre, axis=1).mean() - 0.05) < 0.005
