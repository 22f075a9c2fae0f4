"""Plain solids are closed, stand on the table, and come small and large."""

import numpy as np
from drawn.plain import LEAST, MOST, draw_plain_shape

from brrp_cli.seeds import child_rng


def drawn(number):
    return draw_plain_shape(child_rng(0, "plain", number))


def test_they_are_closed_solids_that_stand_on_the_table():
    lengths = []
    for number in range(60):
        mesh = drawn(number)
        assert mesh.is_watertight and mesh.volume > 0
        assert abs(mesh.bounds[0][2]) < 1e-9
        lengths.append(mesh.extents.max())
    # Round about, a prism is wider than it is long at most by the shortest side's share.
    assert max(lengths) <= MOST + 1e-9 and min(lengths) > LEAST / 3
    assert max(lengths) > 0.8 * MOST and min(lengths) < 2 * LEAST


def test_a_seed_gives_one_shape_and_another_another():
    np.testing.assert_array_equal(drawn(3).vertices, drawn(3).vertices)
    assert drawn(3).volume != drawn(4).volume
