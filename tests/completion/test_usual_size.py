"""A camera cannot tell a large thing far away from a small one near, and the completion does not
either, above the size of what its networks have learned from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import TABLE, in_camera, photograph, placed

from brrp_cli.completion.completed_mean import network_grid
from brrp_cli.completion.usual_size import of_usual_size, resized
from brrp_cli.completion.visible_part import visible_part
from brrp_cli.config import preset
from brrp_cli.inference.mean_grid import grid_over
from brrp_cli.observation.support_plane import Plane
from brrp_cli.shapes import solids

ID = 5
CONFIG = preset("default").hypotheses
CARTON = in_camera(solids.box(0.16, 0.12, 0.14), placed(0.0, 0.0, 0.6))


def seen(times, config):
    """What a frame shows of a carton, with all lengths so many times as long."""
    frame = photograph({ID: CARTON})
    large = replace(frame, points=frame.points * np.float32(times))
    plane = Plane(TABLE.normal, TABLE.offset * times)
    return visible_part(large.object_points(ID), large, ID, plane, config)


def test_a_small_object_is_looked_at_as_it_is():
    part = seen(0.5, CONFIG.completion)
    assert of_usual_size(part) == (part, 1.0)


def test_a_large_one_is_looked_at_as_one_of_the_usual_size():
    part = seen(3.0, CONFIG.completion)
    smaller, scale = of_usual_size(part)
    # Cells of a grid count once, and a smaller object has fewer.
    assert smaller.size == pytest.approx(CONFIG.completion.largest, rel=0.06)
    assert scale == pytest.approx(CONFIG.completion.largest / part.size)
    assert smaller.top == pytest.approx(part.top * scale, rel=0.06)


def test_what_is_resized_looks_as_if_all_lengths_were_others():
    part, larger = seen(1.0, CONFIG.completion), seen(1.5, CONFIG.completion)
    found = resized(part, 1.5)
    # Points are thinned at the size that they have first.
    assert found.size == pytest.approx(larger.size, rel=0.06)
    assert found.top == pytest.approx(larger.top, rel=0.06)
    assert found.plane.offset == pytest.approx(larger.plane.offset)
    np.testing.assert_array_equal(found.silhouette, larger.silhouette)


@pytest.mark.parametrize("times", [2.0, 4.0])
def test_a_larger_carton_is_as_solid(times):
    """Where the network thinks that a carton is, it thinks that one is which is larger."""
    inside = []
    for each in (1.0, times):
        part = seen(each, CONFIG.completion)
        low, high = part.extent.min(axis=0), part.extent.max(axis=0)
        _, _, nodes = grid_over(np.stack([low, high]), 8_000)
        nothing = np.zeros(nodes.shape[:3], bool)
        inside.append((network_grid(nodes, nothing, part, CONFIG.mean) > 0).mean())
    assert inside[1] == pytest.approx(inside[0], abs=0.05)
