"""How far within the silhouette a pixel lies, how thick the part is that it shows, and normals."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.completion.silhouette import local_thickness, within_silhouette
from brrp_cli.completion.visible_part import surface_normals


def disc_with_a_handle():
    rows, columns = np.mgrid[:120, :160]
    disc = np.hypot(rows - 60, columns - 50) < 30
    handle = (np.abs(rows - 60) < 5) & (columns >= 50) & (columns < 130)
    return (disc | handle).astype(np.int64)


def test_within_the_outline_counts_pixels_to_the_background():
    within = within_silhouette(disc_with_a_handle())
    assert within[60, 50] == pytest.approx(30, abs=1)
    assert within[60, 110] == pytest.approx(5, abs=1)
    assert within[5, 5] == 0


def test_what_another_object_hides_may_go_on_and_the_edge_of_the_image_ends_it():
    segmap = np.zeros((40, 40), dtype=np.int64)
    segmap[10:30, 5:20], segmap[10:30, 20:35] = 1, 2
    within = within_silhouette(segmap)
    assert within[20, 19] == pytest.approx(10, abs=1)
    assert within_silhouette(np.ones((40, 40), dtype=np.int64))[20, 0] == 1


def test_a_handle_is_thin_all_over_and_the_disc_thick_to_its_edge():
    segmap = disc_with_a_handle()
    width = local_thickness(within_silhouette(segmap), 12)
    assert width[60, 95:125] == pytest.approx(5, abs=1)
    # 24 pixels from the middle, where the silhouette is 6 pixels away.
    assert width[60 - 24, 50] > 24
    assert width.max() == pytest.approx(30, abs=1)
    np.testing.assert_array_equal(width == 0, segmap == 0)


@pytest.mark.parametrize("count", [1, 3, 400])
def test_normals_are_unit_and_look_at_the_camera(count):
    """On a plane of known slope where there are points enough to tell."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.03, 0.03, (2, count))
    normals = surface_normals(np.column_stack([x, y, 0.8 + 0.5 * x]), 12)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)
    if count == 400:
        expected = np.array([0.5, 0, -1]) / np.hypot(0.5, 1)
        np.testing.assert_allclose(normals, np.tile(expected, (count, 1)), atol=1e-6)
