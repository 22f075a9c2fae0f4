from __future__ import annotations

import matplotlib
import numpy as np
import pytest

from brrp_cli.surface.viridis import viridis


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_colours_are_those_of_matplotlib(precision: type) -> None:
    shares = np.concatenate([np.linspace(-0.5, 1.5, 10_001), [np.nan, np.inf, -np.inf]])
    expected = matplotlib.colormaps["viridis"](shares.astype(precision), bytes=True)
    np.testing.assert_array_equal(viridis(shares.astype(precision)), expected)
