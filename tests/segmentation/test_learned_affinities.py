"""The network that parts objects: its file, and what it says of images of any size."""

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import WeightsError
from brrp_cli.frames.build import make_frame
from brrp_cli.segmentation.affinity_network import AffinityNetwork, AffinityNetworkConfig
from brrp_cli.segmentation.learned_affinities import (
    Affinities,
    affinities_of,
    load_affinity_network,
    save_affinity_network,
    shipped,
)
from brrp_cli.segmentation.pixel_pairs import windows
from brrp_cli.segmentation.seen_surfaces import see_surfaces


def tiny():
    torch.manual_seed(0)
    return AffinityNetwork(AffinityNetworkConfig((4, 4, 4, 8, 8, 8))).eval()


def test_a_file_gives_the_network_back(tmp_path, scene):
    frame = make_frame(rgb=scene.rgb, depth=scene.depth, K=scene.K)
    seen = see_surfaces(frame, 0, SegmentConfig())
    network, path = tiny(), tmp_path / "affinities.safetensors"
    save_affinity_network(network, {"views": 1}, path)
    before = affinities_of(frame.rgb, seen, network)
    after = affinities_of(frame.rgb, seen, load_affinity_network(path))
    np.testing.assert_allclose(before.same, after.same, atol=0.01)
    assert before.restore(before.object).shape == frame.shape
    assert ((before.same > 0) & (before.same < 1)).all()


@pytest.mark.parametrize("bad", ["nothing", "no weights", "another format"])
def test_a_file_that_cannot_be_used_is_named(tmp_path, bad):
    path = tmp_path / "affinities.safetensors"
    if bad == "no weights":
        path.write_bytes(b"\x00" * 100)
    elif bad == "another format":
        save_file({"x": torch.zeros(2)}, path, metadata={"format": "brrp completion 1"})
    with pytest.raises(WeightsError, match="network that parts objects cannot be read") as raised:
        load_affinity_network(path)
    assert str(path) in str(raised.value)


def test_the_networks_image_and_that_of_the_camera_lie_on_each_other():
    nothing = np.zeros((3, 5), np.float32)
    affinities = Affinities(nothing[None], nothing, ((0, 2),), (7, 11))
    few = np.arange(15).reshape(3, 5)
    large = affinities.restore(few)
    assert large.shape == (7, 11) and (large[3:4, 5:6] == 7).all()
    assert np.array_equal(affinities.sample(large), few)


def test_the_network_sees_the_box_that_is_asked_for_and_nothing_else(scene):
    seen = see_surfaces(make_frame(depth=scene.depth, K=scene.K), 0, SegmentConfig())
    asked = np.zeros(scene.depth.shape, bool)
    none = affinities_of(scene.rgb, seen, tiny(), asked=asked, margin=4)
    assert not none.object.any() and not none.same.any()
    asked[40:60, 50:90] = True  # the network's image is twice as large
    found = affinities_of(scene.rgb, seen, tiny(), asked=asked, margin=4)
    box = np.zeros(found.object.shape, bool)
    box[76:124, 96:184] = True
    assert np.array_equal(found.object > 0, box)
    assert (found.same[:, box] > 0).all() and not found.same[:, ~box].any()


@pytest.mark.parametrize("colour", [0.0, 1.0])
def test_the_shipped_network_tells_one_object_from_what_is_beside_it(scene, colour):
    frame = make_frame(rgb=scene.rgb, depth=scene.depth, K=scene.K)
    found = affinities_of(frame.rgb, see_surfaces(frame, 0, SegmentConfig()), shipped(), colour)
    segmap = found.sample(scene.segmap)
    assert np.median(found.object[segmap != 0]) > 0.9
    near = [each for each in zip(found.same, found.offsets, strict=True) if max(each[1]) == 2]
    assert len(near) == 4
    for same, offset in near:
        pixel, partner = windows(offset, segmap.shape)
        first, second = segmap[pixel], segmap[partner]
        one = np.median(same[pixel][(first == second) & (first != 0)])
        assert one > 0.8 and one - np.median(same[pixel][first != second]) > 0.3


def test_without_colour_no_colour_changes_what_the_network_says(scene):
    seen = see_surfaces(make_frame(depth=scene.depth, K=scene.K), 0, SegmentConfig())
    rng = np.random.default_rng(0)
    first, second = (
        affinities_of(rgb, seen, shipped(), 0.0)
        for rgb in (scene.rgb, rng.integers(0, 255, scene.rgb.shape).astype(np.uint8))
    )
    assert np.array_equal(first.same, second.same)
    both = affinities_of(scene.rgb, seen, shipped(), 0.5)
    alone = affinities_of(scene.rgb, seen, shipped(), 1.0)
    np.testing.assert_allclose(both.same, (first.same + alone.same) / 2, atol=1e-6)


def test_torchs_threads_change_no_byte(scene):
    seen = see_surfaces(make_frame(depth=scene.depth, K=scene.K), 0, SegmentConfig())
    before = torch.get_num_threads()
    found = []
    try:
        for threads in (1, 4):
            torch.set_num_threads(threads)
            found.append(affinities_of(scene.rgb, seen, shipped(), 0.5).same.tobytes())
            assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
    assert found[0] == found[1]
