"""The hull of what was seen, and its height_map over the plane."""

from __future__ import annotations

import numpy as np

from brrp_cli.completion.convex_hull import hull_facets
from brrp_cli.completion.height_map import height_map_over
from brrp_cli.config import CompletionConfig
from brrp_cli.geometry import transform_points
from brrp_cli.observation.support_plane import Plane, plane_frame

CONFIG = CompletionConfig()
FLOOR = Plane(np.array([0.0, 0.0, 1.0]), 0.0)


def test_the_roof_is_the_greatest_height_over_each_cell():
    rng = np.random.default_rng(0)
    flat = rng.uniform(0, 0.06, (6000, 2))
    height = np.where(flat[:, 0] < 0.03, 0.05, 0.02)
    points = np.column_stack([flat, height])
    height_map = height_map_over(points, FLOOR, CONFIG)
    probes = np.array([[0.01, 0.03, 0.1], [0.05, 0.03, 0.1], [0.05, 0.03, 0.01], [0.5, 0.5, 0.1]])
    np.testing.assert_allclose(height_map.above(probes), [0.05, 0.08, -0.01, 1.1], atol=1e-9)
    T = plane_frame(FLOOR)
    np.testing.assert_allclose(transform_points(T, probes)[:, 2], probes[:, 2], atol=1e-12)


def test_the_facets_of_a_box_are_its_six_sides_outward():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float)
    facets = hull_facets(corners, 0.0005)
    assert len(facets) == 6
    assert (corners @ facets[:, :3].T + facets[:, 3] < 1e-9).all()
    assert (np.array([0.5, 1, 1.5]) @ facets[:, :3].T + facets[:, 3] < 0).all()
    np.testing.assert_allclose(np.linalg.norm(facets[:, :3], axis=1), 1, atol=1e-6)
