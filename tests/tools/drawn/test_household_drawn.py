import numpy as np
import pytest
from drawn.household import KINDS, draw_household_shape

from brrp_cli.prior.build.solids import is_solid


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_is_a_closed_body_that_fits_a_table(kind):
    for seed in range(3):
        mesh = KINDS[kind](np.random.default_rng(seed))
        assert is_solid(mesh) and mesh.body_count == 1
        assert mesh.bounds[0, 2] == pytest.approx(0, abs=1e-6)
        assert 0.03 < max(mesh.extents) < 0.35


def test_the_generator_decides_kind_and_size():
    one, again, other = (draw_household_shape(np.random.default_rng(s)) for s in (0, 0, 1))
    assert one[0] == again[0]
    np.testing.assert_array_equal(one[1].vertices, again[1].vertices)
    assert one[0] != other[0] or not np.array_equal(one[1].bounds, other[1].bounds)
    kinds = {draw_household_shape(np.random.default_rng(s))[0] for s in range(60)}
    assert len(kinds) > 8
