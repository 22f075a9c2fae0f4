"""One closed surface around convex parts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def union_of_hulls(
    parts: Sequence[NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (n, 3) and faces (m, 3), outward, of the union of the hulls of corners (k, 3)."""
    import manifold3d

    hulls = [manifold3d.Manifold.hull_points(part) for part in parts]
    joined = manifold3d.Manifold.batch_boolean(hulls, manifold3d.OpType.Add).to_mesh64()
    return (
        np.asarray(joined.vert_properties[:, :3], dtype=np.float64),
        np.asarray(joined.tri_verts, dtype=np.int64),
    )
