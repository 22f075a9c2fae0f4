"""Placed shapes and what a frame says of them: noise moves nothing, a contradiction is followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from closed_shapes import CUP_WALL, at, cup
from table_scene import in_camera, photograph, placed

from brrp_cli.config import (
    FittedMapConfig,
    MeanConfig,
    ObservationConfig,
    SensorConfig,
    SurfaceConfig,
)
from brrp_cli.geometry import transform_points
from brrp_cli.inference.infer_hypotheses import Problem, infer_correction
from brrp_cli.observation.ray_samples import observe
from brrp_cli.observation.sensor_noise import depth_deviation
from brrp_cli.observation.soft_samples import soft_samples
from brrp_cli.raycast import inside
from brrp_cli.shapes import solids
from brrp_cli.surface.extract import extract_surface
from brrp_cli.surface.stored_mesh import along_normals, moved_to_level

ID = 5
MAP, SENSOR = FittedMapConfig(), SensorConfig()
T = placed(0.0, 0.0, 0.4)
SIZE = np.array([0.12, 0.10, 0.10])


def block():
    return solids.box(*SIZE)


def notched():
    """The block without a step of 2.5 cm height over half of its top."""
    return solids.difference(
        block(), solids.moved(solids.box(0.06, 0.20, 0.05), x=0.03, z=SIZE[2] - 0.025)
    )


def noisy(frame, seed=0):
    """Depth with the noise that the preset counts on."""
    rng = np.random.default_rng(seed)
    depth = frame.points[..., 2].astype(np.float64)
    error = rng.normal(size=depth.shape) * depth_deviation(depth, SENSOR)
    with np.errstate(invalid="ignore"):
        points = frame.points * (1 + error / depth)[..., None]
    return replace(frame, points=points.astype(np.float32))


WIDTH = MeanConfig().width


def corrected(true, model, frame_of=noisy, width=WIDTH):
    """The posterior of a frame of the solid `true` under the one hypothesis that it is `model`,
    which stands where the solid does."""
    frame = frame_of(photograph({ID: in_camera(true, T)}))
    seen = observe(frame, ObservationConfig(), 0).objects[ID]
    shape = at(model, T, width=width)
    extent = np.concatenate([seen.points.astype(np.float64), shape.bounds])
    box = np.stack([extent.min(axis=0) - MAP.margin, extent.max(axis=0) + MAP.margin])
    noise = SENSOR.sure * depth_deviation(seen.center[2:], SENSOR)[0]
    observed = soft_samples(seen, frame, MAP.behind, SENSOR)
    problem = Problem(observed, (shape,), np.ones(1), np.full(1, MAP.stiffness), noise, box)
    return infer_correction(problem, MAP, seed=0)


def offsets(posterior, config=SurfaceConfig()):  # noqa: B008, frozen
    """How far the mesh is moved along its normals, metres, and the mesh."""
    moved = moved_to_level(along_normals(posterior, 0, config), config.level)
    shape = posterior.means[0]
    return np.einsum("ij,ij->i", moved.vertices - shape.vertices, shape.normals), moved


@pytest.fixture(scope="module")
def cups():
    return corrected(cup(), cup())


def test_noise_moves_no_surface_that_lies_where_the_model_says(cups):
    for posterior in (cups, corrected(block(), block())):
        offset, moved = offsets(posterior)
        assert np.abs(offset).mean() < 1e-4
        assert np.quantile(np.abs(offset), 0.99) < 5e-4
        assert moved.off < 0.01


def test_a_thin_wall_keeps_its_thickness(cups):
    """Behind a wall of 1.5 mm lies free space, 4 mm behind what was measured of it."""
    _, moved = offsets(cups)
    mesh = trimesh.Trimesh(moved.vertices, cups.means[0].shape.faces, process=False)
    true = in_camera(cup(), T)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(true.volume, rel=0.05)
    middle = np.abs(cup().triangles_center[:, 2] - 0.04) < 0.03
    assert middle.any()
    # Points in the middle of the wall are inside, all around, points on either side are not.
    angle, height = np.random.default_rng(0).uniform([0, 0.01], [2 * np.pi, 0.07], (300, 2)).T
    for radius, in_wall in ((0.03425, True), (0.0375, False), (0.031, False)):
        points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
        found = cups.probability(transform_points(T, points)) > 0.5
        np.testing.assert_array_equal(found, in_wall)
    assert CUP_WALL == 0.0015


@pytest.fixture(scope="module")
def contradicted():
    return corrected(notched(), block())


def test_a_step_that_is_not_there_is_taken_away_and_nothing_else(contradicted):
    posterior = contradicted
    rng = np.random.default_rng(0)
    # In the middle of what is missing, half way down.
    missing = rng.uniform([0.02, -0.03, 0.083], [0.045, 0.03, 0.092], (200, 3))
    assert (posterior.probability(transform_points(T, missing)) < 0.5).mean() > 0.95
    kept = rng.uniform([-0.055, -0.045, 0.005], [-0.025, 0.045, 0.095], (200, 3))
    below = rng.uniform([0.01, -0.045, 0.005], [0.055, 0.045, 0.055], (200, 3))
    for solid in (kept, below):
        assert (posterior.probability(transform_points(T, solid)) > 0.5).all()
    # Away from the step the surface stays where it is.
    vertices = transform_points(np.linalg.inv(T), posterior.means[0].vertices)
    offset, moved = offsets(posterior)
    away = vertices[:, 0] < -0.03
    assert np.abs(offset[away]).mean() < 1e-4
    assert moved.off > 0.05, "the mesh cannot be moved so far"


def test_the_surface_is_that_of_what_is_there(contradicted):
    """Marching cubes, where the mesh cannot follow; the hidden sides are the model's."""
    true = in_camera(notched(), T)
    surface = extract_surface(contradicted, true.vertices, SurfaceConfig()).as_trimesh()
    points = np.random.default_rng(0).uniform(*in_camera(block(), T).bounds, (20_000, 3))

    def iou(mesh):
        found, right = inside(mesh, points), inside(true, points)
        return (found & right).sum() / (found | right).sum()

    assert surface.is_watertight and surface.body_count == 1
    assert iou(surface) > max(0.93, iou(in_camera(block(), T)) + 0.04)


def test_the_hidden_side_of_a_contradicted_shape_stays(contradicted):
    posterior = contradicted
    vertices = transform_points(np.linalg.inv(T), posterior.means[0].vertices)
    offset, _ = offsets(posterior)
    bottom = (vertices[:, 2] < 1e-6) & (np.abs(vertices[:, :2]) < 0.8 * SIZE[:2] / 2).all(axis=1)
    assert bottom.sum() > 10
    assert np.abs(offset[bottom]).max() < 2e-4
