"""A posterior over hypotheses: its uncertainty in metres, its grid, its file."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest
import trimesh
from closed_shapes import at

from brrp_cli.config.inference import SpreadConfig
from brrp_cli.errors import BrrpError
from brrp_cli.geometry import similarity
from brrp_cli.inference.hinge import HingeGrid
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.mean_grid import MeanGrid
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.methods.posterior_file import open_posterior
from brrp_cli.results.posterior_file import save_posteriors

CENTER = np.array([0.1, -0.2, 0.9])
GRID = HingeGrid((-0.05, -0.05, -0.05), (3, 3, 3), 0.05, 1e-7)
SPACING = 0.0025
SPREAD = SpreadConfig()


def of_means(means, box, which=None, shares=None, weights=0.0):
    which = np.arange(len(means)) if which is None else np.array(which)
    shares = np.full(len(which), 1 / len(which)) if shares is None else np.array(shares)
    particles = np.random.default_rng(0).normal(0, 1, (len(which), GRID.dimension)) * weights
    correction = HilbertPosterior(particles.astype(np.float32), CENTER, GRID, 0.06)
    return HypothesisPosterior(tuple(means), which, shares, correction, box)


def posterior(*functions, **kind):
    """Hypotheses with logits that are functions of x (n,), metres from the centre."""
    x = np.arange(-0.06, 0.0601, SPACING)
    lower = CENTER + [-0.06, -4 * SPACING, -4 * SPACING]
    means = [
        MeanGrid(
            lower,
            SPACING,
            np.broadcast_to(f(x)[:, None, None], (len(x), 9, 9)).astype(np.float16),
            outside=-5.0,
        )
        for f in functions
    ]
    return of_means(means, means[0].bounds, **kind)


def ramp(width, place=0.0):
    """Occupied where x is less than `place`."""
    return lambda x: (place - x) / width


SHARES = (0.5, 0.2, 0.3)


def mixed():
    """Two hypotheses, three particles that weigh differently, each with weights of its own."""
    return posterior(ramp(0.02), ramp(0.02, 0.01), which=(0, 1, 1), shares=SHARES, weights=0.5)


@pytest.fixture(scope="module")
def shapes():
    """A box, and the same shape at another place, both under one name; a ball."""
    box = at(trimesh.creation.box((0.04, 0.03, 0.05)), similarity(translation=CENTER), name="box")
    shift = similarity(translation=np.array([0.004, 0.0, 0.0]))
    ball = at(trimesh.creation.icosphere(2, 0.02), similarity(translation=CENTER), name="ball")
    return box, replace(box, T_cam_shape=shift @ box.T_cam_shape), ball


@pytest.mark.parametrize("width", [0.002, 0.0025])
def test_the_spread_of_a_logistic_surface_is_that_of_its_distribution(width):
    """sigmoid(-x / s) is a logistic distribution of the surface's place: pi s / sqrt(3)."""
    found = posterior(ramp(width)).surface_uncertainty(CENTER[None])
    # Between nodes 2.5 mm apart, difference quotients over 2 mm are a little too flat.
    assert found[0] == pytest.approx(np.pi * width / np.sqrt(3), rel=0.05)
    assert found.dtype == np.float32


def test_a_surface_that_is_little_known_is_not_told_to_be_anywhere():
    """Beyond `steep`, twice as gentle a slope makes the spread 2^0.6 times as large."""
    one, two = (
        posterior(ramp(each)).surface_uncertainty(CENTER[None])[0] for each in (0.005, 0.01)
    )
    own, steep = np.pi * 0.005 / np.sqrt(3), SPREAD.steep
    assert one == pytest.approx(steep * (own / steep) ** SPREAD.growth, rel=0.05)
    assert two / one == pytest.approx(2**SPREAD.growth, rel=0.05)


def test_another_spread_is_asked_for_and_kept(tmp_path):
    gentle = posterior(ramp(0.01))
    other = replace(gentle, spread=SpreadConfig(steep=0.004, growth=0.5, most=0.009))
    found = other.surface_uncertainty(CENTER[None])
    own = np.pi * 0.01 / np.sqrt(3)
    assert found[0] == pytest.approx(0.004 * (own / 0.004) ** 0.5, rel=0.05)
    assert found < gentle.surface_uncertainty(CENTER[None])
    save_posteriors({1: other, 2: gentle}, tmp_path / "a.h5")
    read = open_posterior(tmp_path / "a.h5")
    assert (read[1].spread, read[2].spread) == (other.spread, SPREAD)
    np.testing.assert_array_equal(read[1].surface_uncertainty(CENTER[None]), found)


def test_the_spread_does_not_depend_on_which_way_the_surface_faces():
    along_x = posterior(ramp(0.005))
    (mean,) = along_x.means
    turned = replace(along_x, means=(replace(mean, values=mean.values[::-1]),))
    middle = mean.bounds.mean(axis=0)
    np.testing.assert_allclose(
        along_x.surface_uncertainty(middle[None]), turned.surface_uncertainty(middle[None])
    )


def test_two_hypotheses_apart_are_less_certain_than_one():
    one = posterior(ramp(0.003), which=(0, 0))
    two = posterior(ramp(0.003, -0.01), ramp(0.003, 0.01))
    middle = CENTER[None]
    assert one.probability(middle)[0] == pytest.approx(0.5, abs=0.01)
    assert two.probability(middle)[0] == pytest.approx(0.5, abs=0.01)
    assert two.surface_uncertainty(middle)[0] > 2 * one.surface_uncertainty(middle)[0]
    assert two.uncertainty(middle)[0] > 0.2


def test_what_depth_is_off_alike_is_added_to_completed_surfaces_in_squares(shapes):
    sharp = posterior(ramp(0.001))
    alone = sharp.surface_uncertainty(CENTER[None])
    wavy = replace(sharp, common=0.003).surface_uncertainty(CENTER[None])
    np.testing.assert_allclose(wavy, np.hypot(alone, 0.003), rtol=1e-5)
    # A placement has it in its pose's covariance.
    only = of_means([shapes[0]], shapes[0].bounds)
    vertices = shapes[0].vertices[:20]
    np.testing.assert_array_equal(
        replace(only, common=0.003).surface_uncertainty(vertices),
        only.surface_uncertainty(vertices),
    )


def test_where_nothing_says_where_the_surface_is_the_spread_is_the_largest():
    flat = posterior(lambda x: np.zeros_like(x))
    assert flat.surface_uncertainty(CENTER[None])[0] == pytest.approx(SPREAD.most)


def test_probability_is_the_weighted_mean_over_particles_of_mean_and_correction():
    two = mixed()
    points = CENTER + np.random.default_rng(1).uniform(-0.008, 0.008, (20, 3))
    means = np.stack([mean.logits(points) for mean in two.means])
    logits = means[[0, 1, 1]] + two.correction.logits(points)
    np.testing.assert_allclose(two.logits(points), logits)
    expected = np.array(SHARES) @ (1 / (1 + np.exp(-logits.astype(np.float64))))
    np.testing.assert_allclose(two.probability(points), expected, atol=1e-6)
    np.testing.assert_allclose(two.uncertainty(points), expected * (1 - expected), atol=1e-6)
    np.testing.assert_allclose(two.weights, [0.5, 0.5])


def test_out_of_bounds_nothing_is_occupied(shapes):
    """Though the mean would have it so."""
    box, _, _ = shapes
    half = np.stack([CENTER - 0.05, CENTER + [0.0, 0.05, 0.05]])
    found = of_means([box], half)
    points = CENTER + np.array([[-0.01, 0, 0], [0.01, 0, 0], [9.0, 0, 0]])
    np.testing.assert_allclose(found.probability(points), [0.993, 0, 0], atol=1e-3)
    assert (found.bounds == half).all()


def test_the_volume_equals_the_points():
    two = mixed()
    axes = tuple(np.linspace(-0.008, 0.009, n) + c for n, c in zip((3, 4, 5), CENTER, strict=True))
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(
        two.probability_volume(axes).ravel(), two.probability(points), atol=1e-5
    )
    volumes = two.particle_volumes(axes)
    assert volumes.shape == (3, 3, 4, 5)
    np.testing.assert_allclose(
        volumes.reshape(3, -1), 1 / (1 + np.exp(-two.logits(points))), atol=1e-5
    )


def test_placements_of_one_object_dominate_together(shapes):
    box, beside, ball = shapes
    bounds = np.stack([CENTER - 0.05, CENTER + 0.05])

    def dominant(*weights, means=(box, beside, ball)):
        return of_means(means, bounds, shares=weights).dominant

    assert dominant(0.2, 0.35, 0.45) == 1, "0.55 for the box, of which the second weighs more"
    assert dominant(0.35, 0.2, 0.45) == 0
    assert dominant(0.1, 0.1, 0.8) == 2
    assert dominant(0.25, 0.25, 0.5) is None, "no more than a half"
    grid = posterior(ramp(0.01)).means[0]
    assert dominant(0.25, 0.25, 0.5, means=(box, ball, grid)) is None
    assert dominant(0.1, 0.2, 0.7, means=(box, ball, grid)) is None, "a completed shape is no mesh"
    assert dominant(0.6, 0.1, 0.3, means=(box, ball, grid)) == 0


def test_the_weight_of_a_hypothesis_is_that_of_all_its_particles(shapes):
    box, _, ball = shapes
    bounds = np.stack([CENTER - 0.05, CENTER + 0.05])
    found = of_means([ball, box], bounds, which=(0, 1, 1, 1), shares=(0.4, 0.2, 0.2, 0.2))
    np.testing.assert_allclose(found.weights, [0.4, 0.6])
    assert found.dominant == 1


def test_the_heaviest_hypothesis_alone_is_the_mean_of_its_own_particles():
    both = mixed()
    points = CENTER + np.random.default_rng(1).uniform(-0.009, 0.009, (50, 3))
    # The first has one particle and half of the weight.
    occupied = 1 / (1 + np.exp(-both.logits(points)))
    np.testing.assert_allclose(both.heaviest().probability(points), occupied[0], atol=1e-6)
    second = replace(both, shares=np.array([0.1, 0.3, 0.6])).heaviest()
    expected = (occupied[1] + 2 * occupied[2]) / 3
    np.testing.assert_allclose(second.probability(points), expected, atol=1e-6)
    assert second.weights == pytest.approx([1])


@pytest.mark.parametrize("ask", ["probability", "uncertainty"])
def test_it_is_asked_at_points_alone(ask):
    for posterior_ in (mixed(), mixed().correction):
        assert getattr(posterior_, ask)([[0.1, -0.2, 0.9]]).shape == (1,)
        with pytest.raises(BrrpError, match="no points"):
            getattr(posterior_, ask)([1, 2])


def test_the_file_gives_the_same_probabilities_and_the_same_bytes(tmp_path):
    two = mixed()
    plain = two.correction
    save_posteriors({7: two, -3: plain}, tmp_path / "a.h5")
    save_posteriors({7: two, -3: plain}, tmp_path / "b.h5")
    found = open_posterior(tmp_path / "a.h5")
    points = CENTER + np.random.default_rng(1).uniform(-0.08, 0.08, (200, 3))
    np.testing.assert_array_equal(found[7].probability(points), two.probability(points))
    np.testing.assert_array_equal(
        found[7].surface_uncertainty(points), two.surface_uncertainty(points)
    )
    np.testing.assert_array_equal(found[7].bounds, two.bounds)
    np.testing.assert_array_equal(found[-3].probability(points), plain.probability(points))
    assert isinstance(found[7], HypothesisPosterior)
    assert isinstance(found[-3], HilbertPosterior)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_placed_shapes_come_back_from_the_file_whole(shapes, tmp_path):
    box, beside, ball = shapes
    grid = posterior(ramp(0.01)).means[0]
    bounds = np.stack([CENTER - 0.05, CENTER + 0.05])
    first = of_means(
        [box, beside, ball, grid], bounds, which=(0, 0, 1, 2, 3),
        shares=(0.2, 0.2, 0.3, 0.1, 0.2), weights=0.3,
    )  # fmt: skip
    second = of_means([beside], bounds)
    save_posteriors({7: first, 2: second}, tmp_path / "a.h5")
    found = open_posterior(tmp_path / "a.h5")
    points = CENTER + np.random.default_rng(1).uniform(-0.06, 0.06, (500, 3))
    np.testing.assert_array_equal(found[7].probability(points), first.probability(points))
    np.testing.assert_array_equal(found[7].shares, first.shares)
    assert found[7].dominant == first.dominant == 0
    assert found[2].dominant == 0
    again = found[7].means[1]
    assert isinstance(again, PlacedShape) and isinstance(found[7].means[3], MeanGrid)
    assert (again.name, again.width, again.limit) == ("box", beside.width, beside.limit)
    np.testing.assert_array_equal(again.T_cam_shape, beside.T_cam_shape)
    for key in ("vertices", "faces", "colours"):
        np.testing.assert_array_equal(getattr(again.shape, key), getattr(beside.shape, key))
        assert getattr(again.shape, key).dtype == getattr(beside.shape, key).dtype
    # One shape for all its placements, in the file and when it is read.
    assert again.shape is found[7].means[0].shape is found[2].means[0].shape
    with h5py.File(tmp_path / "a.h5") as file:
        assert len(file["shared"]) == 2


def without_which(path):
    with h5py.File(path, "r+") as file:
        del file["objects/7/which"]


def of_a_hypothesis_that_is_not_there(path):
    with h5py.File(path, "r+") as file:
        del file["objects/7/which"]
        file["objects/7/which"] = np.array([0, 1, 2])


def of_no_known_kind(path):
    with h5py.File(path, "r+") as file:
        file["objects/7/means/1"].attrs["kind"] = "another"


def cut(path):
    path.write_bytes(path.read_bytes()[:-300])


def flipped(path):
    """One bit of a mean's compressed bytes."""
    with h5py.File(path) as file:
        place = file["objects/7/means/0/values"].id.get_chunk_info(0).byte_offset + 20
    data = bytearray(path.read_bytes())
    data[place] ^= 4
    path.write_bytes(data)


@pytest.mark.parametrize(
    "damage",
    [without_which, of_a_hypothesis_that_is_not_there, of_no_known_kind, cut, flipped],
)
def test_a_damaged_file_is_refused(tmp_path, damage):
    path = tmp_path / "posterior.h5"
    save_posteriors({7: mixed()}, path)
    damage(path)
    with pytest.raises(BrrpError, match="cannot be read") as caught:
        open_posterior(path)
    assert "brrp reconstruct" in str(caught.value)


def test_a_shape_with_corners_that_are_not_there_is_refused(shapes, tmp_path):
    path = tmp_path / "posterior.h5"
    save_posteriors({7: of_means(shapes[:1], np.stack([CENTER - 1, CENTER + 1]))}, path)
    with h5py.File(path, "r+") as file:
        file["shared/shape/faces"][3, 1] = 10**6
    with pytest.raises(BrrpError, match="corners that it lacks"):
        open_posterior(path)
