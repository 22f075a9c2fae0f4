"""Numbers as the files spell them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray


def spell(values: Iterable[float]) -> str:
    """Numbers with blanks between them; nine digits are a micrometre at a kilometre."""
    return " ".join(f"{float(value):.9g}" for value in values)


def quaternion_wxyz(rotation: NDArray[np.floating]) -> list[float]:
    """Unit quaternion (w, x, y, z), w >= 0, of a rotation (3, 3), as MuJoCo and cuRobo order it."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat(canonical=True)
    return [float(w), float(x), float(y), float(z)]
