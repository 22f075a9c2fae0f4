"""Depth loses the noise of single pixels and keeps its edges and curves."""

from __future__ import annotations

import numpy as np
import pytest
from table_scene import TABLE, ball, box, in_camera, photograph, placed

from brrp_cli.config import FittedDepthConfig, SensorConfig
from brrp_cli.depth_noise.structured_light import add_depth_noise
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.fitted_depth import smoothed
from brrp_cli.observation.pixel_noise import pixel_noise
from brrp_cli.shapes import solids

OWN, OTHER = 5, 6
CONFIG = FittedDepthConfig()


def noisy(frame, deviation, seed=0):
    """The same, every point moved along its ray by noise of so many metres."""
    rng = np.random.default_rng(seed)
    z = frame.points[..., 2:]
    moved = frame.points * (1 + deviation * rng.standard_normal(z.shape).astype(np.float32) / z)
    return frame.with_points(moved.astype(np.float32))


def errors(meshes, deviation):
    """Metres, of the depth of object 5 before and after."""
    clean = photograph(meshes)
    frame = noisy(clean, deviation)
    found = smoothed(frame, OWN, pixel_noise(frame, TABLE, SensorConfig()), CONFIG)
    own = (clean.segmap == OWN) & clean.valid
    return frame.depth[own] - clean.depth[own], found.depth[own] - clean.depth[own]


@pytest.mark.parametrize("mesh", [box(), ball(), solids.cylinder(0.03, 0.1)])
def test_noise_is_averaged(mesh):
    before, after = errors({OWN: in_camera(mesh, placed(0.0, 0.0, 0.5))}, 0.001)
    assert np.abs(after).mean() < 0.7 * np.abs(before).mean()
    assert abs(after.mean()) < 0.0001


@pytest.mark.parametrize("mesh", [box(), ball(), solids.cylinder(0.03, 0.1)])
def test_a_structured_light_cameras_noise_is_averaged(mesh):
    """It reads pixels beside, and in steps, which is no Gaussian noise."""
    clean = photograph({OWN: in_camera(mesh, placed(0.0, 0.0, 0.5))})
    depth = add_depth_noise(clean.depth, clean.K, np.random.default_rng(0))
    seen = np.where(depth > 0, depth, np.nan)[..., None]
    frame = clean.with_points((clean.points / clean.depth[..., None] * seen).astype(np.float32))
    noise = pixel_noise(frame, TABLE, SensorConfig())
    found = smoothed(frame, OWN, noise, CONFIG)
    own = (clean.segmap == OWN) & frame.valid & ~noise.at_jump
    before, after = (np.abs(each.depth - clean.depth)[own] for each in (frame, found))
    assert after.mean() < 0.5 * before.mean()
    assert (found.depth[own] == frame.depth[own]).mean() < 0.05


def test_no_edge_is_rounded_off():
    """What is off where there was no noise is less than what noise makes of it."""
    _, after = errors({OWN: in_camera(box(), placed(0.0, 0.0, 0.5))}, 0.0)
    assert np.quantile(np.abs(after), 0.99) < 0.0005


def test_a_plane_stays_as_it_is():
    rows, columns = np.mgrid[0:40, 0:50]
    K = np.array([[300.0, 0, 25], [0, 300, 20], [0, 0, 1]])
    depth = 1 / (1.2 + 0.002 * rows + 0.004 * columns)
    rays = np.stack([(columns - 25) / 300, (rows - 20) / 300, np.ones_like(depth)], axis=-1)
    points = (rays * depth[..., None]).astype(np.float32)
    frame = Frame(np.zeros((40, 50, 3), np.uint8), points, np.full((40, 50), OWN), K)
    found = smoothed(frame, OWN, pixel_noise(frame, None, SensorConfig()), CONFIG)
    np.testing.assert_allclose(found.points, frame.points, atol=1e-6)


def test_only_the_objects_points_move_and_along_their_rays():
    frame = noisy(
        photograph(
            {
                OWN: in_camera(box(), placed(0.0, -0.08, 0.5)),
                OTHER: in_camera(box(), placed(0.0, 0.1, 0.5)),
            }
        ),
        0.001,
    )
    found = smoothed(frame, OWN, pixel_noise(frame, TABLE, SensorConfig()), CONFIG)
    own = frame.segmap == OWN
    np.testing.assert_array_equal(found.points[~own], frame.points[~own])
    before, after = frame.points[own & frame.valid], found.points[own & frame.valid]
    assert (before != after).any()
    np.testing.assert_allclose(
        before[:, :2] / before[:, 2:], after[:, :2] / after[:, 2:], atol=1e-6
    )
    assert not found.points.flags.writeable


def test_an_object_without_depth_stays_as_it_is():
    frame = photograph({OWN: in_camera(box(), placed(0.0, 0.0, 0.5))})
    points = frame.points.copy()
    points[frame.segmap == OWN] = np.nan
    blind = frame.with_points(points)
    assert smoothed(blind, OWN, pixel_noise(blind, TABLE, SensorConfig()), CONFIG) is blind
