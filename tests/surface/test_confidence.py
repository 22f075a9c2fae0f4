"""The surface that holds an object with a given probability, against posteriors in closed form."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from closed_shapes import at
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from made_result import posterior_on
from scipy.stats import chi, norm

from brrp_cli.config import SurfaceConfig
from brrp_cli.inference.particles import particle_shares, particle_volumes
from brrp_cli.raycast import inside
from brrp_cli.surface.around_mesh import (
    around_axes,
    beyond_reach,
    marching_cubes_of,
    reach_of_alike,
)
from brrp_cli.surface.confidence import confidence_level, confidence_surface, simultaneous
from brrp_cli.surface.extract import extract_surface, grid_axes

CENTER = np.array([0.1, -0.05, 0.8])
RADIUS, WIDTH = 0.03, 0.003
CONFIG = SurfaceConfig(level=0.5, spacing=0.003)


def ball(center=CENTER, radius=RADIUS, width=WIDTH):
    """Logits of a ball whose radius is logistic with scale `width`."""
    return lambda points: (radius - np.linalg.norm(points - center, axis=1)) / width


def box(half_width):
    return np.stack([CENTER - half_width, CENTER + half_width])


def logit(p):
    return np.log(p / (1 - p))


def reach(surface, center=CENTER):
    """Mean distance of the vertices from a centre."""
    return np.linalg.norm(surface.vertices - center, axis=1).mean()


@pytest.mark.parametrize("confidence", [0.6, 0.9, 0.95, 0.99])
def test_one_particle_has_its_quantile(confidence):
    """A ball of logistic radius lies within the radius r + s logit(c) with probability c."""
    posterior = posterior_on([ball()], box(0.06), spacing=0.0015)
    found = confidence_surface(posterior, CENTER[None] + [0.03, 0, 0], confidence, CONFIG)
    assert found.level == pytest.approx(1 - confidence, rel=0.1)
    assert reach(found) == pytest.approx(RADIUS + WIDTH * logit(confidence), abs=5e-4)
    assert found.bounded and found.confidence == confidence


def test_what_each_point_allows_is_too_little_for_the_whole():
    """Eight equally probable balls at eight places: a point outside of the level set at 1 - c may
    still be occupied with probability 8 (1 - c) in one of them, and any one of them may be it."""
    shifts = 0.05 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    centers = CENTER + shifts
    posterior = posterior_on([ball(c, 0.02) for c in centers], box(0.09), which=np.arange(8))
    confidence = 0.9
    found = confidence_surface(posterior, centers + [0.02, 0, 0], confidence, CONFIG)
    # Outside of C_t each ball has at most 8 t; all of them together are missed with 8 t.
    assert found.level == pytest.approx((1 - confidence) / 8, rel=0.1)
    away = np.linalg.norm(found.vertices[:, None] - centers, axis=2).min(axis=1)
    # Of most: thin routes join the balls to one piece.
    away = np.median(away)
    assert away == pytest.approx(0.02 + WIDTH * logit(confidence), abs=5e-4)
    pointwise = 0.02 + WIDTH * logit(1 - 8 * (1 - confidence))
    assert away - pointwise > 0.004


@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_drawn_shapes_lie_inside_as_often_as_it_says(confidence):
    """O = {p_i > u}, drawn 20,000 times on the grid."""
    rng = np.random.default_rng(0)
    functions = [ball(CENTER + rng.normal(0, 0.006, 3), 0.025, w) for w in (0.001, 0.002, 0.004)]
    posterior = posterior_on(functions, box(0.07), which=(0, 1, 1, 2))
    volumes = particle_volumes(posterior, grid_axes(posterior.bounds, 0.003)).reshape(4, -1)
    level = confidence_level(volumes, confidence)
    outside = volumes.mean(axis=0) < level
    which, u = rng.integers(4, size=20_000), rng.random(20_000)
    inside = volumes[:, outside].max(axis=1)[which] <= u
    assert inside.mean() >= confidence - 0.01
    assert inside.mean() <= confidence + 0.03, "no smaller region would do"


@settings(deadline=None)
@given(
    arrays(np.float32, (3, 40), elements=st.floats(0, 1, width=32)),
    st.floats(0.5, 0.999),
)
def test_the_level_is_the_largest_that_holds(volumes, confidence):
    # Points whose means are equal have to stay so: the sum is taken as the code takes it.
    shares = np.full(3, 1 / 3)
    mean = shares @ volumes

    def missed(level):
        outside = mean < level
        return shares @ volumes[:, outside].max(axis=1) if outside.any() else 0.0

    level = confidence_level(volumes, confidence)
    allowed = 1 - confidence
    if level is None:
        assert volumes.max(axis=1).mean() <= allowed + 1e-5
        return
    assert missed(level) <= allowed + 1e-5
    higher = mean[mean > level]
    if len(higher):
        assert missed(higher.min()) >= allowed - 1e-5
    # Never more than what each point allows alone.
    assert (mean[mean < level] <= allowed + 1e-5).all()


def test_it_is_closed_and_holds_the_mesh_and_grows():
    posterior = posterior_on([ball(), ball(radius=0.035)], box(0.07), which=(0, 1, 1))
    observed = CENTER[None] + [0.03, 0, 0]
    inner = extract_surface(posterior, observed, CONFIG)
    for confidence in (0.7, 0.9, 0.97):
        outer = confidence_surface(posterior, observed, confidence, CONFIG)
        mesh = trimesh.Trimesh(outer.vertices, outer.faces, process=False)
        assert mesh.is_watertight and mesh.volume > 0
        assert (posterior.probability(inner.vertices) > outer.level).all()
        assert reach(outer) > reach(inner)
        inner = outer


def test_the_end_of_the_map_is_told():
    posterior = posterior_on([ball()], box(0.035))
    found = confidence_surface(posterior, CENTER[None] + [0.03, 0, 0], 0.99, CONFIG)
    assert not found.bounded
    assert trimesh.Trimesh(found.vertices, found.faces, process=False).is_watertight


def test_nothing_is_left_of_an_object_that_is_probably_nowhere():
    def nowhere(points):
        return np.full(len(points), -5.0)

    posterior = posterior_on([nowhere], box(0.03))
    assert confidence_surface(posterior, CENTER[None], 0.9, CONFIG) is None


def test_particles_average_to_the_posterior():
    posterior = posterior_on([ball(), ball(radius=0.02)], box(0.05), which=(0, 1, 1))
    axes = grid_axes(posterior.bounds, 0.005)
    volumes = particle_volumes(posterior, axes)
    assert len(volumes) == 3
    np.testing.assert_allclose(volumes.mean(axis=0), posterior.probability_volume(axes), atol=1e-6)


def test_a_margin_grows_it_but_not_into_space_that_was_seen_to_be_empty():
    posterior = posterior_on([ball()], box(0.05))
    observed = CENTER[None] + [0.03, 0, 0]
    margin, confidence = 0.02, 0.9

    def empty(points):
        return points[:, 0] > CENTER[0]

    plain = confidence_surface(posterior, observed, confidence, CONFIG)
    grown = confidence_surface(posterior, observed, confidence, CONFIG, margin, empty)
    x, radius = (grown.vertices - CENTER)[:, 0], np.linalg.norm(grown.vertices - CENTER, axis=1)
    # Two grid steps from the border between the two halves each keeps to its own rule.
    assert radius[x > 0.006].mean() == pytest.approx(reach(plain), abs=5e-4)
    assert radius[x < -0.006].mean() == pytest.approx(reach(plain) + margin, abs=0.002)
    assert radius.max() > 0.05, "it goes on where the posterior's box ends"
    mesh = trimesh.Trimesh(grown.vertices, grown.faces, process=False)
    assert mesh.is_watertight and mesh.volume > 0
    assert grown.level == plain.level and grown.bounded


def test_it_is_never_smaller_than_the_mesh():
    """A method whose surface lies at 0.3 is sure of it before it is sure of 0.4."""
    config = SurfaceConfig(level=0.3, spacing=0.003)
    posterior = posterior_on([ball()], box(0.05))
    found = confidence_surface(posterior, CENTER[None] + [0.03, 0, 0], 0.6, config)
    assert found.level == 0.3


def test_particles_count_by_their_weight():
    """A ball that is known, and a larger one with a tenth of the weight: as long as it is allowed
    to be missed, the region is that of the first."""
    two = posterior_on([ball(width=0.0005), ball(radius=0.04, width=0.0005)], box(0.06), (0, 1))
    weighted = replace(two, shares=np.array([0.9, 0.1]))
    observed = CENTER[None] + [0.03, 0, 0]
    assert reach(confidence_surface(weighted, observed, 0.8, CONFIG)) == pytest.approx(
        0.03, abs=0.002
    )
    assert reach(confidence_surface(weighted, observed, 0.95, CONFIG)) == pytest.approx(
        0.04, abs=0.002
    )
    assert reach(confidence_surface(two, observed, 0.8, CONFIG)) == pytest.approx(0.04, abs=0.002)
    axes = grid_axes(two.bounds, 0.004)
    volumes = particle_volumes(weighted, axes)
    mean = np.tensordot(particle_shares(weighted, 2), volumes, axes=1)
    np.testing.assert_allclose(mean, weighted.probability_volume(axes), atol=1e-6)
    np.testing.assert_array_equal(particle_shares(two.correction, 4), [0.25] * 4)


def placed_box(covariance, **more):
    return replace(at(trimesh.creation.box([0.06, 0.08, 0.1])), covariance=covariance, **more)


def test_a_band_around_a_placed_shape_holds_all_of_it_at_once():
    """A shift along one axis moves a ball outwards at one pole by its own length, so that the band
    is the two-sided quantile of a normal variable; a shift along all three, by its length: that of
    chi with three degrees of freedom."""
    ball = at(trimesh.creation.icosphere(subdivisions=4, radius=0.03))
    one, three = np.zeros((6, 6)), np.zeros((6, 6))
    one[3, 3], three[3:, 3:] = 1e-6, 1e-6 * np.eye(3)
    found = simultaneous(replace(ball, covariance=one), 0.95, CONFIG)
    assert found == pytest.approx(norm.ppf(0.975), rel=0.04)
    found = simultaneous(replace(ball, covariance=three), 0.95, CONFIG)
    assert found == pytest.approx(chi.ppf(0.95, 3), rel=0.04)
    assert simultaneous(ball, 0.95, CONFIG) == 0, "a pose that is known"


def test_a_turn_that_is_as_probable_lies_inside():
    """A box on a table that may as well be turned by 20 degrees."""
    turn = np.eye(4)
    turn[:3, :3] = trimesh.transformations.rotation_matrix(np.radians(20), [0, 0, 1])[:3, :3]
    alone = placed_box(1e-8 * np.eye(6))
    both = replace(alone, alike=(turn @ alone.T_cam_shape)[None])
    reach = reach_of_alike(both, CONFIG)
    assert reach_of_alike(alone, CONFIG).max() == 0
    # A corner of the turned box lies beyond the side by as much as it turned out.
    corner = 0.03 * np.cos(np.radians(20)) + 0.04 * np.sin(np.radians(20)) - 0.03
    assert reach.max() == pytest.approx(corner, rel=0.05)
    axes = around_axes(both, float(reach.max()), SurfaceConfig(around_nodes=400_000))
    region = trimesh.Trimesh(
        *marching_cubes_of(-beyond_reach(both, reach, axes, 0.0), axes), process=False
    )
    vertices = replace(both, T_cam_shape=both.alike[0]).vertices
    assert inside(region, 0.999 * vertices).all()
