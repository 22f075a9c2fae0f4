"""Metres across a surface for a metre along the sight, against planes and a ball."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.config.inference import SlantConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, normalise
from brrp_cli.observation.slant import across_surface

CONFIG = SlantConfig(blur=2.0, least=0.25)
K = np.array([[200.0, 0, 80], [0, 210, 60], [0, 0, 1]])
SHAPE, OWN = (120, 160), 3
RAYS = backproject(np.ones(SHAPE), K).astype(np.float64)
WINDOW = (slice(20, 100), slice(30, 130))


def frame_of(depth, window=WINDOW):
    """A surface's depth (H, W) inside of a mask, before a wall."""
    segmap = np.zeros(SHAPE, np.int64)
    segmap[window] = OWN
    image = np.where(segmap == OWN, depth, 3.0)
    return Frame(np.zeros((*SHAPE, 3), np.uint8), backproject(image, K), segmap, K)


@pytest.mark.parametrize("normal", [[0, 0, -1], [0.5, 0, -1], [0, -1.2, -1], [0.7, 0.8, -1]])
def test_on_a_plane_it_is_the_cosine_of_the_lean(normal):
    normal = normalise(np.array(normal, float))
    along = RAYS @ normal
    found = across_surface(frame_of(normal[2] / along), OWN, CONFIG)
    np.testing.assert_allclose(found[WINDOW], np.maximum(-along[WINDOW], 0.25), atol=0.01)
    assert (found[:20] == 1).all(), "beside the object"


def test_on_a_ball_it_falls_towards_the_outline():
    center, radius = np.array([0.0, 0.0, 1.0]), 0.2
    a, b = (RAYS**2).sum(axis=-1), RAYS @ center
    root = b**2 - a * (center @ center - radius**2)
    depth = (b - np.sqrt(np.maximum(root, 0))) / a
    inner = root > 0.3 * root.max()
    segmap = np.where(root > 0, OWN, 0)
    points = backproject(np.where(root > 0, depth, 3.0), K)
    found = across_surface(Frame(np.zeros((*SHAPE, 3), np.uint8), points, segmap, K), OWN, CONFIG)
    normals = (depth[..., None] * RAYS - center) / radius
    expected = np.abs((normals * RAYS).sum(axis=-1))
    np.testing.assert_allclose(found[inner], expected[inner], atol=0.05)
    assert found[60, 80] > found[60, 100] > found[60, 115]


def test_steep_slopes_are_limited():
    steep = normalise(np.array([0.0, -8.0, -1.0]))
    depth = steep[2] / np.where(RAYS @ steep < -0.02, RAYS @ steep, -0.02)
    found = across_surface(frame_of(depth, (slice(70, 110), slice(60, 100))), OWN, CONFIG)
    assert found.min() == pytest.approx(CONFIG.least)


@pytest.mark.parametrize("pixels", [(60, 80), (slice(60, 62), slice(70, 100))])
def test_what_is_too_small_for_a_slope_counts_as_seen_straight_on(pixels):
    frame = frame_of(np.ones(SHAPE), pixels)
    assert (across_surface(frame, OWN, CONFIG) == 1).all()
    assert (across_surface(frame, OWN + 1, CONFIG) == 1).all()


def test_holes_take_the_slope_around_them():
    normal = normalise(np.array([0.8, 0.0, -1.0]))
    frame = frame_of(normal[2] / (RAYS @ normal))
    points = frame.points.copy()
    points[50:53, 60:63] = np.nan
    points[60, 90:120] = np.nan
    found = across_surface(frame.with_points(points), OWN, CONFIG)
    seen = np.isfinite(points[..., 2]) & (frame.segmap == OWN)
    np.testing.assert_allclose(found[seen], -(RAYS @ normal)[seen], atol=0.01)
