"""Maps of known shapes: the right axes, signs and units."""

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config import InferenceConfig, SurfaceConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.inference.infer import LabelledPoints, infer_posterior
from brrp_cli.methods.posterior_file import open_posterior
from brrp_cli.results.posterior_file import save_posteriors
from brrp_cli.surface.extract import extract_surface

# Fewer particles than the paper has, in a smaller cube: the same code in a second.
CONFIG = replace(InferenceConfig(), hinge_half_width=0.1, particles=4, epochs=15)
CENTER = np.array([0.3, -0.2, 1.1])
RNG = np.random.default_rng(0)


def sphere(points):
    return np.linalg.norm(points, axis=1) < 0.06


def box_off_centre(points):
    """Three different half-extents, moved by three different offsets."""
    return (np.abs(points - [0.02, -0.01, 0.03]) < [0.06, 0.035, 0.045]).all(axis=1)


ROTATION = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def rotated_l(points):
    """Two bars at a right angle, turned about no axis of the grid: no symmetry at all."""
    local = points @ ROTATION
    upright = (np.abs(local - [-0.035, 0, 0]) < [0.025, 0.03, 0.07]).all(axis=1)
    foot = (np.abs(local - [0.02, 0, -0.045]) < [0.06, 0.03, 0.025]).all(axis=1)
    return upright | foot


def labelled(shape, count, seed):
    points = np.random.default_rng(seed).uniform(-0.12, 0.12, (count, 3))
    return LabelledPoints(points + CENTER, shape(points))


def infer(shape, *, seed=0, components=1):
    return infer_posterior(
        labelled(shape, 6000, 2),
        [labelled(shape, 6000, 3 + i) for i in range(components)],
        [1.0 / components] * components,
        CENTER,
        CONFIG,
        reach=0.12,
        seed=seed,
    )


@pytest.mark.parametrize("shape", [sphere, box_off_centre, rotated_l])
def test_recovers_the_shape_where_it_is(shape):
    posterior = infer(shape)
    points = RNG.uniform(-0.1, 0.1, (8000, 3))
    predicted = posterior.probability(points + CENTER) > 0.5
    true = shape(points)
    assert (predicted & true).sum() / (predicted | true).sum() > 0.8


def test_the_prior_fills_what_was_not_observed():
    """Half of a sphere is observed; the registered component knows the rest."""
    seen = labelled(sphere, 6000, 2)
    front = seen.points[:, 2] < CENTER[2]
    observed = LabelledPoints(seen.points[front], seen.labels[front])
    posterior = infer_posterior(
        observed, [labelled(sphere, 6000, 3)], [1.0], CENTER, CONFIG, reach=0.12, seed=0
    )
    alone = infer_posterior(observed, [], [], CENTER, CONFIG, reach=0.12, seed=0)
    points = RNG.uniform(-0.08, 0.08, (4000, 3))
    points = points[points[:, 2] > 0.01]
    true = sphere(points)

    def accuracy(found):
        return ((found.probability(points + CENTER) > 0.5) == true).mean()

    assert accuracy(posterior) > 0.9
    assert accuracy(posterior) > accuracy(alone) + 0.1


def test_unobserved_space_is_less_certain_than_observed_space():
    seen = labelled(sphere, 6000, 2)
    front = seen.points[:, 2] < CENTER[2]
    observed = LabelledPoints(seen.points[front], seen.labels[front])
    posterior = infer_posterior(observed, [], [], CENTER, CONFIG, reach=0.12, seed=0)
    offset = np.array([0.0, 0.0, 0.05])
    near, far = posterior.uncertainty(np.stack([CENTER - offset, CENTER + offset]))
    assert far > 2 * near


def test_same_seed_same_bytes_other_seed_other_particles():
    first, second, other = infer(sphere), infer(sphere), infer(sphere, seed=1)
    assert first.weights.tobytes() == second.weights.tobytes()
    assert first.weights.tobytes() != other.weights.tobytes()


def test_the_volume_equals_the_points():
    posterior = infer(box_off_centre)
    axes = tuple(np.linspace(-0.08, 0.08, n) + c for n, c in zip((3, 4, 5), CENTER, strict=True))
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(
        posterior.probability_volume(axes).ravel(), posterior.probability(points), atol=1e-4
    )


def test_the_surface_is_closed_outward_and_in_metres():
    posterior = infer(box_off_centre)
    observed = CENTER + np.array([[0.02, -0.01, -0.015]])  # on the face towards the camera
    surface = extract_surface(posterior, observed, SurfaceConfig())
    mesh = surface.as_trimesh()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.12 * 0.07 * 0.09, rel=0.15)
    np.testing.assert_allclose(mesh.bounds.mean(axis=0), CENTER + [0.02, -0.01, 0.03], atol=0.006)
    np.testing.assert_allclose(mesh.extents, [0.12, 0.07, 0.09], atol=0.015)


def test_parts_that_nobody_saw_are_dropped():
    def two_spheres(points):
        left, right = points + [0.06, 0, 0], points - [0.06, 0, 0]
        return (np.linalg.norm(left, axis=1) < 0.035) | (np.linalg.norm(right, axis=1) < 0.035)

    surface = extract_surface(infer(two_spheres), CENTER + [[-0.06, 0, -0.035]], SurfaceConfig())
    assert (surface.vertices[:, 0] < CENTER[0]).all()


def test_nothing_near_the_observed_points_gives_no_surface():
    far = CENTER + [[0.1, 0.1, 0.1]]
    assert extract_surface(infer(sphere), far, SurfaceConfig()) is None


def test_the_posterior_survives_its_file(tmp_path):
    posterior = infer(sphere)
    save_posteriors({7: posterior, -3: posterior}, tmp_path / "a.h5")
    save_posteriors({7: posterior, -3: posterior}, tmp_path / "b.h5")
    found = open_posterior(tmp_path / "a.h5")
    points = CENTER + RNG.uniform(-0.1, 0.1, (50, 3))
    assert set(found) == {7, -3}
    np.testing.assert_array_equal(found[7].probability(points), posterior.probability(points))
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_transforming_the_prior_samples_moves_the_map():
    """T_cam_object is applied to stored samples: a scaled, moved sphere comes out there."""
    T_cam_object = similarity(scale=0.05, translation=CENTER + [0.02, 0, 0])
    stored = np.random.default_rng(5).uniform(-2, 2, (6000, 3))
    samples = LabelledPoints(
        transform_points(T_cam_object, stored), np.linalg.norm(stored, axis=1) < 1
    )
    posterior = infer_posterior(samples, [samples], [1.0], CENTER, CONFIG, reach=0.12, seed=0)
    inside, outside = CENTER + [0.06, 0, 0], CENTER - [0.045, 0, 0]
    assert posterior.probability(inside[None])[0] > 0.5
    assert posterior.probability(outside[None])[0] < 0.5


def test_a_component_that_is_left_alone_counts_in_full_however_improbable():
    def posterior(probability):
        return infer_posterior(
            labelled(sphere, 2000, 2),
            [labelled(sphere, 2000, 3)],
            [probability],
            CENTER,
            CONFIG,
            reach=0.12,
            seed=0,
        )

    np.testing.assert_array_equal(posterior(0.0).weights, posterior(1.0).weights)
    np.testing.assert_array_equal(posterior(1e-60).weights, posterior(1.0).weights)
