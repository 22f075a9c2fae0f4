"""The network that parts objects: its file, and what it says of images of any size."""

from concurrent.futures import ThreadPoolExecutor

import bin_scene
import numpy as np
import onnx
import pytest
import room_scene
import torch
from training.affinity_file import load_weights, save_affinity_network
from training.affinity_network import AffinityNetwork, AffinityNetworkConfig

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import WeightsError
from brrp_cli.frames.build import make_frame
from brrp_cli.segmentation.image_channels import CHANNELS
from brrp_cli.segmentation.learned_affinities import (
    NAME,
    WALLED_NAME,
    Affinities,
    AffinityModel,
    affinities_in,
    affinities_of,
    shipped,
)
from brrp_cli.segmentation.pixel_pairs import OFFSETS, windows
from brrp_cli.segmentation.rising import rising_in
from brrp_cli.segmentation.seen_surfaces import see_surfaces
from brrp_cli.shapes import solids


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A small network, and its file."""
    torch.manual_seed(0)
    network = AffinityNetwork(AffinityNetworkConfig((4, 4, 4, 8, 8, 8))).eval()
    with torch.no_grad():
        # No two are equal, as after training: the exporter keeps one of those that are.
        for each in network.parameters():
            each += 0.05 * torch.randn_like(each)
    path = tmp_path_factory.mktemp("network") / "affinities.onnx"
    save_affinity_network(network, {"views": 1}, path)
    return network, path


@pytest.fixture(scope="module")
def tiny(place):
    return AffinityModel(place[1])


@pytest.mark.parametrize("size", [(64, 96), (75, 133), (20, 24)])
def test_a_file_says_what_the_network_says(place, tiny, size):
    channels = np.random.default_rng(0).normal(0, 1, (CHANNELS, *size)).astype(np.float32)
    with torch.no_grad():
        said = torch.sigmoid(place[0](torch.from_numpy(channels)[None]))[0].numpy()
    found = tiny(channels)
    assert found.shape == (len(OFFSETS) + 1, *size)
    # Weights are stored in half precision.
    np.testing.assert_allclose(found, said, atol=0.01)
    assert np.ptp(said) > 0.05


def test_a_training_begins_with_the_weights_of_a_file(place):
    network, path = place
    weights = load_weights(path)
    own = network.state_dict()
    assert weights.keys() == own.keys()
    for name, tensor in weights.items():
        np.testing.assert_array_equal(tensor, own[name].half().float())


@pytest.mark.parametrize("bad", ["nothing", "no model", "another format"])
@pytest.mark.parametrize("read", [AffinityModel, load_weights])
def test_a_file_that_cannot_be_used_is_named(place, tmp_path, bad, read):
    path = tmp_path / "affinities.onnx"
    if bad == "no model":
        path.write_bytes(b"\x00" * 100)
    elif bad == "another format":
        model = onnx.load(place[1])
        onnx.helper.set_model_props(model, {"format": "brrp affinities 0"})
        onnx.save(model, path)
    with pytest.raises(WeightsError, match="network that parts objects cannot be read") as raised:
        read(path)
    assert str(path) in str(raised.value)


def test_threads_that_ask_at_once_get_what_one_gets(tiny):
    rng = np.random.default_rng(1)
    asked = [rng.normal(0, 1, (CHANNELS, 64, 96)).astype(np.float32) for _ in range(8)]
    alone = [tiny(each).tobytes() for each in asked]
    with ThreadPoolExecutor(4) as pool:
        assert [each.tobytes() for each in pool.map(tiny, asked)] == alone


def test_the_networks_image_and_that_of_the_camera_lie_on_each_other():
    nothing = np.zeros((3, 5), np.float32)
    affinities = Affinities(nothing[None], nothing, ((0, 2),), (7, 11))
    few = np.arange(15).reshape(3, 5)
    large = affinities.restore(few)
    assert large.shape == (7, 11) and (large[3:4, 5:6] == 7).all()
    assert np.array_equal(affinities.sample(large), few)


def test_the_network_sees_the_box_that_is_asked_for_and_nothing_else(scene, tiny):
    seen = see_surfaces(make_frame(depth=scene.depth, K=scene.K), 0, SegmentConfig())
    asked = np.zeros(scene.depth.shape, bool)
    none = affinities_of(scene.rgb, seen, tiny, asked=asked, margin=4)
    assert not none.object.any() and not none.same.any()
    asked[40:60, 50:90] = True  # the network's image is twice as large
    found = affinities_of(scene.rgb, seen, tiny, asked=asked, margin=4)
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


BIN_FRAME = bin_scene.seen(bin_scene.standing((0.08, 0.06, 0.07), 0.05, 0.02))
SHELF_FRAME = room_scene.photograph(
    room_scene.THINGS, room_scene.shelf(), elevation=0.25, distance=0.9
)
PLATFORM_FRAME = bin_scene.seen(
    bin_scene.standing((0.08, 0.06, 0.07), 0.05, 0.02), bin=solids.box(0.4, 0.3, 0.02)
)


@pytest.mark.parametrize(
    ("frame", "name"),
    [
        (room_scene.photograph(room_scene.THINGS, [room_scene.TABLE]), NAME),
        (
            room_scene.photograph(room_scene.THINGS, [room_scene.TABLE, room_scene.wall()]),
            WALLED_NAME,
        ),
        (SHELF_FRAME, WALLED_NAME),
        (BIN_FRAME, WALLED_NAME),
        (PLATFORM_FRAME, WALLED_NAME),
    ],
    ids=["table", "wall", "shelf", "bin", "platform"],
)
def test_the_network_that_knows_walls_is_asked_where_there_is_more_than_a_table(frame, name):
    config = SegmentConfig()
    seen = see_surfaces(frame, 0, config)
    own = config.affinities
    risen = rising_in(frame, seen, config).risen
    said = affinities_of(frame.rgb, seen, shipped(name), own.colour, risen, own.margin)
    assert np.array_equal(affinities_in(frame, seen, config).same, said.same)
    assert said.same.any()


@pytest.mark.parametrize(("frame", "least"), [(BIN_FRAME, 0.03), (SHELF_FRAME, 0.05)])
def test_the_network_that_knows_walls_takes_them_for_none_of_the_objects(frame, least):
    seen = see_surfaces(frame, 0, SegmentConfig())
    other, said = (
        affinities_of(frame.rgb, seen, shipped(name), 0.5) for name in (NAME, WALLED_NAME)
    )
    thing = said.sample(frame.segmap) == 1
    walls = said.sample(frame.segmap == 0) & (said.sample(seen.height) > least)
    assert walls.sum() > 1000
    assert np.median(said.object[thing]) > 0.8
    # To the one that knows tables alone they are objects.
    assert np.median(said.object[walls]) < 0.25 < 0.75 < np.median(other.object[walls])
