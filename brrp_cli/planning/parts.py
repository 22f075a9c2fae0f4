"""Convex parts whose union holds a closed mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.planning import PartsConfig
from brrp_cli.dependencies import import_library
from brrp_cli.errors import DependencyError

Array = NDArray[np.float64]

COACD, HULL = "coacd", "hull"
HOW = (COACD, HULL)


def convex_parts(
    vertices: Array,
    faces: NDArray[np.int64],
    how: str,
    seed: int,
    config: PartsConfig,
) -> list[Array]:
    """Corners (k, 3) of convex parts that together hold every vertex (n, 3) of a closed mesh.

    how : "hull", one part, or "coacd", as many as it takes to keep hollows deeper than
    `config.concavity` (Wei et al., SIGGRAPH 2022). The same seed gives the same parts. Errors:
    DependencyError without the library `coacd`.
    """
    if how == HULL:
        return [hull_corners(vertices)]
    parts = _decomposed(vertices, faces, seed, config)
    return cover([hull_corners(part) for part in parts], vertices)


def check_available(how: str) -> None:
    """DependencyError now, not after the work, where `how` lacks its library."""
    if how != COACD:
        return
    try:
        import_library("coacd")
    except DependencyError as error:
        fix = f"{error.fix}; or take --collision {HULL}, which needs no library"
        raise DependencyError(error.what, found=error.found, fix=fix) from error


def hull_corners(points: Array) -> Array:
    """The points (k, 3) of (n, 3) that are corners of their convex hull."""
    from scipy.spatial import ConvexHull

    return np.asarray(points[np.sort(ConvexHull(points).vertices)], dtype=np.float64)


def cover(parts: list[Array], points: Array) -> list[Array]:
    """The parts, each grown to the points (n, 3) that lie in no part and are nearest to it."""
    outside = np.stack([beyond_hull(part, points) for part in parts])
    nearest = outside.argmin(axis=0)
    stray = outside.min(axis=0) > 0
    return [
        hull_corners(np.vstack([part, points[stray & (nearest == i)]]))
        for i, part in enumerate(parts)
    ]


def beyond_hull(part: Array, points: Array) -> Array:
    """How far (n,), metres, points (n, 3) lie beyond the worst face of the hull of `part` (k, 3);
    negative inside."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(part).equations
    return np.asarray((points @ planes[:, :3].T + planes[:, 3]).max(axis=1))


def _decomposed(
    vertices: Array, faces: NDArray[np.int64], seed: int, config: PartsConfig
) -> list[Array]:
    coacd: Any = import_library("coacd")
    coacd.set_log_level("error")
    # CoACD measures in a cube of half-width 1 around the mesh, and takes 0.01 to 1.
    half_width = float(np.ptp(vertices, axis=0).max()) / 2
    parts = coacd.run_coacd(
        coacd.Mesh(vertices, faces),
        threshold=float(np.clip(config.concavity / half_width, 0.01, 1.0)),
        # Marching cubes leave a closed 2-manifold; remeshing it would move its surface.
        preprocess_mode="off",
        mcts_iterations=config.iterations,
        seed=seed,
    )
    found = [np.asarray(corners, dtype=np.float64) for corners, _ in parts]
    return [part for part in found if _is_solid(part)] or [vertices]


def _is_solid(part: Array) -> bool:
    """Whether the corners (k, 3) span more than a sheet of a hundredth of a millimetre."""
    spread = np.linalg.svd(part - part.mean(axis=0), compute_uv=False)
    return len(part) > 3 and float(spread[-1]) > 1e-5
