import numpy as np
import trimesh
from training.queries import AROUND, AROUND_MARGIN, FAR_HALF_WIDTH, NEAR, draw_queries

from brrp_cli.geometry import similarity
from brrp_cli.raycast import Solid

SCALE, COUNT = 0.15, 4000


def ball(radius):
    return Solid(trimesh.creation.icosphere(5, radius))


def test_labels_are_those_of_the_points_that_are_given():
    shift = np.array([0.02, -0.01, 0.03])
    queries, labels = draw_queries(
        ball(0.05), similarity(translation=shift), COUNT, SCALE, np.random.default_rng(0)
    )
    assert queries.dtype == np.float16 and labels.dtype == bool
    distance = np.linalg.norm(queries.astype(float) * SCALE - shift, axis=1)
    # Facets of the ball lie up to 0.1 mm inside of it.
    sure = np.abs(distance - 0.05) > 2e-4
    np.testing.assert_array_equal(labels[sure], distance[sure] < 0.05)
    assert 0.1 < labels.mean() < 0.5


def test_a_scaled_solid_is_asked_at_its_size():
    """A mesh in millimetres, posed with a scale, gets the queries of the one in metres."""
    mm = similarity(0.001, translation=np.zeros(3))
    one = draw_queries(ball(50.0), mm, COUNT, SCALE, np.random.default_rng(0))
    other = draw_queries(ball(0.05), np.eye(4), COUNT, SCALE, np.random.default_rng(0))
    np.testing.assert_allclose(one[0].astype(float), other[0].astype(float), atol=2e-3)
    assert (one[1] == other[1]).mean() > 0.999


def test_shares_near_around_and_far():
    queries, _ = draw_queries(ball(0.05), np.eye(4), COUNT, SCALE, np.random.default_rng(0))
    points = queries.astype(float) * SCALE
    near, around, far = np.split(points, [int(NEAR * COUNT), int((NEAR + AROUND) * COUNT)])
    off = np.abs(np.linalg.norm(near, axis=1) - 0.05)
    assert np.median(off) < 0.02
    assert np.abs(around).max() < 0.05 + AROUND_MARGIN + 1e-3
    assert 0.95 * FAR_HALF_WIDTH < np.abs(far).max() < FAR_HALF_WIDTH + 1e-3
