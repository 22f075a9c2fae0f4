"""Solids of no kind are solids."""

import numpy as np
from drawn.composed import MOST, PARTS, draw_composed_shape

from brrp_cli.seeds import child_rng


def drawn(number):
    return draw_composed_shape(child_rng(0, "composed", number))


def test_composed_shapes_are_closed_solids_of_a_size_to_grasp():
    for number in range(25):
        mesh = drawn(number)
        assert mesh.is_watertight and mesh.volume > 0
        # The longest diagonal of a part, and each further part begins in the box of the last one.
        assert mesh.extents.max() < 2 * PARTS[1] * MOST


def test_a_seed_gives_one_shape_and_another_another():
    np.testing.assert_array_equal(drawn(3).vertices, drawn(3).vertices)
    assert drawn(3).volume != drawn(4).volume
