import pytest
import torch
from eight_objects import NETWORK

from brrp_cli.methods.pointsdf.network import NetworkConfig, PointConv, PointSDF, density, nearest


def clouds(batch=3, points=NETWORK.points):
    return torch.rand(batch, points, 3, generator=torch.Generator().manual_seed(0)) - 0.5


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    return PointSDF(NETWORK).eval()


def test_a_batch_answers_as_its_members_do_alone(network):
    batch, queries = clouds(), clouds(3, 40)
    together = network(batch, queries)
    assert together.shape == (3, 40)
    for i in range(3):
        torch.testing.assert_close(
            network(batch[i : i + 1], queries[i : i + 1])[0], together[i], rtol=1e-4, atol=1e-5
        )


def test_a_query_is_answered_whatever_is_asked_beside_it(network):
    code, queries = network.encode(clouds(1)), clouds(1, 50)
    torch.testing.assert_close(
        network.decode(code, queries[:, 7:9]), network.decode(code, queries)[:, 7:9]
    )


def test_the_cloud_decides(network):
    """Before a training it does so only a little: each layer mixes what the one before it gave."""
    queries = clouds(1, 50)
    one, other = network(clouds(1), queries), network(2 * clouds(1), queries)
    assert (one - other).abs().max() > 1e-6
    assert not torch.allclose(network.encode(clouds(1)), network.encode(2 * clouds(1)), rtol=1e-3)


def test_the_published_layers_are_the_default():
    config = NetworkConfig()
    network = PointSDF(config)
    assert [layer.centres for layer in network.encoder.layers] == [256, 256, 64, 36]
    assert [layer.bandwidth for layer in network.encoder.layers] == [0.05, 0.1, 0.2, 0.4]
    assert {layer.neighbours for layer in network.encoder.layers} == {32}
    assert network.encoder.code[0].in_features == 36 * 512
    assert network.encode(clouds(2, 256)).shape == (2, 256)


def test_neighbours_are_the_nearest():
    points = clouds(2, 30)
    found = nearest(points[:, :4], points, 5)
    distance = (points[:, :4, None] - points[:, None]).norm(dim=-1)
    for b in range(2):
        for s in range(4):
            assert set(found[b, s].tolist()) == set(distance[b, s].argsort()[:5].tolist())


def test_density_is_that_of_the_kernel():
    # Two points a bandwidth apart: (1 + exp(-1/2)) / 2 each, were they alone.
    places = torch.tensor([[[0.0, 0, 0], [0.1, 0, 0], [9, 0, 0], [9, 0, 0.0]]])
    near = (1 + torch.exp(torch.tensor(-0.5))) / 4
    expected = torch.tensor([[near, near, 0.5, 0.5]])
    torch.testing.assert_close(density(places, 0.1), expected)


def test_a_layer_moves_with_its_cloud():
    """What a centre gets depends on where its neighbours lie from it, and not on where it is."""
    torch.manual_seed(0)
    layer = PointConv(8, 6, 0.1, 2, (5, 7)).eval()
    places = clouds(2, 20)
    features = torch.rand(2, 20, 2)
    centres, found = layer(places, features)
    moved_centres, moved = layer(places + 0.25, features)
    torch.testing.assert_close(found, moved, rtol=1e-3, atol=1e-4)
    torch.testing.assert_close(moved_centres, centres + 0.25)
    torch.testing.assert_close(centres, places[:, :8])
    assert found.shape == (2, 8, 7) and found.std() > 0
