from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from mesh_zoo import ball_with_small_hole, bowl_sheet, mug, thin_bowl, winding_number

from brrp_cli.prior.build.repair import repair
from brrp_cli.prior.build.samples import draw_samples, inside, surface_points
from brrp_cli.prior.parameters import SampleMix


def normalised(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    mesh.apply_scale(2 / mesh.extents.max())
    return mesh


@pytest.mark.parametrize("make", [thin_bowl, mug, bowl_sheet, ball_with_small_hole])
def test_labels_agree_with_the_winding_number(make: Callable[[], trimesh.Trimesh]) -> None:
    mesh = normalised(repair(make()).mesh)
    points, labels = draw_samples(mesh, 600, SampleMix(), np.random.default_rng(5))
    winding = winding_number(mesh, points.astype(np.float64))
    assert (labels == (winding > 0.5)).mean() >= 0.995
    assert 0.01 < labels.mean() < 0.6


def test_a_ball_off_centre_has_its_sign_axes_and_units() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.3)
    ball.apply_translation((0.5, -0.2, 0.1))
    points = np.random.default_rng(0).uniform(-1, 1, size=(4000, 3))
    distance = np.linalg.norm(points - (0.5, -0.2, 0.1), axis=1)
    clear = np.abs(distance - 0.3) > 0.005
    np.testing.assert_array_equal(inside(ball, points)[clear], (distance < 0.3)[clear])


def test_the_mix_is_what_the_parameters_say() -> None:
    mesh = normalised(trimesh.creation.box((2.0, 1.0, 0.5)))
    mix = SampleMix(uniform=0.5, reach=3.0, offsets=(0.1, 0.025))
    points, _ = draw_samples(mesh, 8000, mix, np.random.default_rng(1))
    assert points.dtype == np.float32
    assert points.shape == (8000, 3)
    beyond = np.abs(points) - np.array([1.0, 0.5, 0.25])
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
    distance = np.where(outside > 0, outside, -beyond.max(axis=1))
    # Of the near half, at least 95 % lie within 2 sigma of the surface; few uniform ones do.
    assert (distance < 0.2).mean() > 0.45
    assert (distance < 0.05).mean() > 0.3
    # The uniform half fills a cube: one in eight lies in that of half its width.
    assert (np.abs(points) <= 3).all()
    assert (np.abs(points) < 1.5).all(axis=1).mean() == pytest.approx(0.5 + 0.5 / 8, abs=0.02)
    # Any leading part has the whole's mix.
    assert (distance[:1000] < 0.05).mean() == pytest.approx((distance < 0.05).mean(), abs=0.05)


def test_surface_points_lie_on_the_surface_by_area() -> None:
    mesh = trimesh.creation.box((2.0, 1.0, 0.5))
    points, normals = surface_points(mesh, 4000, np.random.default_rng(2))
    on_face = np.isclose(np.abs(points), np.array([1.0, 0.5, 0.25]))
    assert on_face.any(axis=1).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert (np.einsum("ij,ij->i", points, normals) > 0).all()
    share = (np.abs(normals[:, 2]) > 0.9).mean()
    assert share == pytest.approx(2 * 2 * 1 / mesh.area, abs=0.03)
