"""The unit in which depth cameras hand out depth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import Array


def whole_millimetres(depth: Array) -> NDArray[np.float64]:
    """Depth in metres, rounded to millimetres as 16-bit depth images hold it."""
    return np.asarray(np.rint(np.asarray(depth, dtype=np.float64) * 1000) / 1000)
