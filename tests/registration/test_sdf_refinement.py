"""Many placements slide onto a surface at once, and draws of matches find a known motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from stored_example import example, with_field

from brrp_cli.config import RegistrationConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.registration.batched_ransac import ransac_motions
from brrp_cli.registration.model import Model
from brrp_cli.registration.sdf_refinement import refine_to_sdf

HALF = np.array([0.05, 0.03, 0.02])


def box_distance(points):
    """Exact, to a box of half-extents HALF."""
    off = np.abs(points) - HALF
    outside = np.linalg.norm(np.maximum(off, 0), axis=-1)
    return outside + np.minimum(off.max(axis=-1), 0)


@pytest.fixture(scope="module")
def field():
    low, spacing = -(HALF + 0.03), 0.0025
    axes = [np.arange(a, -a + spacing, spacing) for a in low]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return DistanceField(low, spacing, box_distance(nodes).astype(np.float32))


@pytest.fixture(scope="module")
def model(field):
    nothing = np.zeros((0, 3))
    return Model(with_field(example("box"), field, half_extent=1.0), nothing, nothing)


@pytest.fixture(scope="module")
def surface():
    """Points of three faces of the box, as a camera sees it."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (300, 3)) * HALF
    face = rng.integers(3, size=300)
    points[np.arange(300), face] = HALF[face]
    return points


def moved(seed, degrees, metres):
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(np.deg2rad(degrees) * rng.standard_normal(3) / np.sqrt(3))
    return similarity(1.0, turn.as_matrix(), metres * rng.standard_normal(3) / np.sqrt(3))


def test_slope_and_distance_are_those_of_the_field(field):
    points = np.random.default_rng(1).uniform(-0.1, 0.1, (500, 3))
    distance, slope = field.distance_and_gradient(points.T.astype(np.float32))
    np.testing.assert_allclose(distance, field.signed_distance(points), atol=1e-6)
    np.testing.assert_allclose(field.distance(points.T.astype(np.float32)), distance, atol=1e-6)
    step = 1e-5
    for axis, unit in enumerate(np.eye(3)):
        ahead, back = (field.signed_distance(points + s * step * unit) for s in (1, -1))
        quotient = (ahead - back) / (2 * step)
        # But for points whose quotient reaches over a cell's face.
        assert np.quantile(np.abs(quotient - slope[axis]), 0.97) < 1e-2


@pytest.mark.parametrize("scale", [1.0, 1.2])
def test_placements_slide_onto_the_surface(model, surface, scale):
    T_cam_true = moved(7, 40, 0.3)
    T_cam_true[:3, :3] *= scale
    observed = transform_points(T_cam_true, surface)
    T_true_cam = np.linalg.inv(T_cam_true)
    starts = np.stack([moved(seed, 8, 0.008) @ T_true_cam for seed in range(6)])
    found = refine_to_sdf(starts, observed, model, 0.03, 15)
    for start, T in zip(starts, found, strict=True):
        before, after = (np.abs(box_distance(transform_points(t, observed))) for t in (start, T))
        assert after.mean() < 2e-4 < before.mean()
        assert np.linalg.det(T[:3, :3]) == pytest.approx(scale**-3)


def test_a_placement_that_nothing_pulls_stays(model, surface):
    far = similarity(translation=np.array([1.0, 0, 0]))
    found = refine_to_sdf(np.stack([far, np.eye(4)]), surface, model, 0.01, 15)
    np.testing.assert_array_equal(found[0], far)
    np.testing.assert_allclose(found[1], np.eye(4), atol=2e-3)


def size_of(T_model_cam):
    """Of what was seen, in the model's size."""
    return np.cbrt(np.linalg.det(T_model_cam[:3, :3])) ** -1


@pytest.mark.parametrize("size", [0.85, 1.0, 1.2])
@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_a_box_of_another_size_gets_its_size(model, surface, size, noise):
    """Seen from all sides."""
    T_cam_true = moved(7, 40, 0.3)
    T_cam_true[:3, :3] *= size
    surface = np.concatenate([surface, -surface])
    error = np.random.default_rng(2).normal(0, noise, (600, 3))
    observed = transform_points(T_cam_true, surface) + error
    # Rigid starts: nothing says how large it is.
    rigid = moved(7, 40, 0.3)
    starts = np.stack([moved(seed, 5, 0.004) @ np.linalg.inv(rigid) for seed in range(4)])
    found = refine_to_sdf(starts, observed, model, 0.03, 25, resize=True)
    for T in found:
        assert size_of(T) == pytest.approx(size, rel=0.01)
        placed_at = transform_points(T, transform_points(T_cam_true, surface))
        assert np.abs(box_distance(placed_at)).mean() < 3e-4


def test_noise_makes_nothing_larger(model, surface):
    """Three faces of a box leave its size open: any larger one has the same. Where nothing speaks
    for another size, it stays."""
    T_cam_true = moved(7, 40, 0.3)
    for seed in range(3):
        error = np.random.default_rng(seed).normal(0, 0.001, (300, 3))
        observed = transform_points(T_cam_true, surface) + error
        start = np.linalg.inv(T_cam_true)[None]
        (found,) = refine_to_sdf(start, observed, model, 0.03, 25, resize=True)
        assert size_of(found) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("radius", [0.025, 0.036])
def test_a_ball_of_another_size_gets_its_size_from_its_front(radius):
    """The model's radius is 3 cm; a cap of the front is seen."""
    spacing = 0.0025
    axis = np.arange(-0.06, 0.06 + spacing, spacing)
    nodes = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    distance = (np.linalg.norm(nodes, axis=-1) - 0.03).astype(np.float32)
    field = DistanceField(np.full(3, axis[0]), spacing, distance)
    nothing = np.zeros((0, 3))
    ball = Model(with_field(example("ball"), field, half_extent=1.0), nothing, nothing)
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    center = np.array([0.1, 0.0, 0.7])
    observed = center + radius * directions[directions[:, 2] < -0.3]
    start = similarity(translation=-center + [0.003, -0.002, 0.004])
    (found,) = refine_to_sdf(start[None], observed, ball, 0.03, 25, resize=True)
    assert size_of(found) * 0.03 == pytest.approx(radius, rel=0.01)
    # A ball's middle is where its surface says.
    np.testing.assert_allclose(transform_points(found, center), 0, atol=3e-4)


def test_without_resizing_a_placement_keeps_its_size(model, surface):
    """Though another would fit better."""
    (found,) = refine_to_sdf(np.eye(4)[None], 1.2 * surface, model, 0.03, 15)
    assert size_of(found) == pytest.approx(1.0, abs=1e-9)
    (resized,) = refine_to_sdf(np.eye(4)[None], 1.2 * surface, model, 0.03, 15, resize=True)
    assert size_of(resized) == pytest.approx(1.2, rel=0.01)


CONFIG = RegistrationConfig(iterations=3000)


def matches(wrong, seed=0):
    """60 pairs under a known motion, of which the first `wrong` are mismatched."""
    rng = np.random.default_rng(seed)
    source = rng.uniform(-0.08, 0.08, (60, 3))
    T = moved(3, 100, 0.2)
    target = transform_points(T, source) + rng.normal(0, 0.0005, source.shape)
    target[:wrong] = rng.permutation(target[:wrong]) + 0.03
    return source, target, T


def test_draws_find_the_motion_among_wrong_matches():
    source, target, T = matches(40)
    found = ransac_motions(source, target, CONFIG, 4, np.random.default_rng(0))
    assert len(found) == 4
    for each in found:
        off = transform_points(each, source[40:]) - transform_points(T, source[40:])
        assert np.linalg.norm(off, axis=1).max() < CONFIG.correspondence_distance
        assert np.linalg.det(each[:3, :3]) == pytest.approx(1)


def test_matches_that_never_hold_together_give_nothing():
    rng = np.random.default_rng(0)
    source, target = rng.uniform(-1, 1, (2, 30, 3))
    assert ransac_motions(source, 50 * target, CONFIG, 2, rng) == []
    assert ransac_motions(source[:2], target[:2], CONFIG, 2, rng) == []


def test_the_same_seed_draws_the_same():
    source, target, _ = matches(40)
    one, two = (
        ransac_motions(source, target, CONFIG, 2, np.random.default_rng(5)) for _ in range(2)
    )
    np.testing.assert_array_equal(one, two)
