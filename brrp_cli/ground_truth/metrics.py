"""Shape metrics: intersection over union, Chamfer distance, F-score.

A prediction that holds nothing has IoU 0 and F-score 0 but no Chamfer distance: NaN, which the
caller counts apart from the mean.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import grid_nodes

if TYPE_CHECKING:
    import trimesh

Points = NDArray[np.floating]


def evaluation_grid(center: Points, half_width: float, spacing: float) -> NDArray[np.float64]:
    """Nodes (m^3, 3) of the cubic grid around `center` (3,), metres; x varies slowest.

    The grid is symmetric about the center, which is a node, and reaches the last whole step within
    `half_width`: 27^3 nodes with the published 1.5 cm over +-0.2 m.
    """
    steps = int(np.floor(half_width / spacing + 1e-9))
    axis = np.arange(-steps, steps + 1) * spacing
    nodes = grid_nodes([axis] * 3).reshape(-1, 3)
    return np.asarray(nodes + np.asarray(center, dtype=np.float64))


def iou(predicted: NDArray[np.bool_], true: NDArray[np.bool_]) -> float:
    """Intersection over union of two occupancies (n,) at the same points; 0 if both are empty."""
    union = np.count_nonzero(predicted | true)
    return float(np.count_nonzero(predicted & true) / union) if union else 0.0


def sample_surface(
    mesh: trimesh.Trimesh, count: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Points (count, 3), uniform over the surface; (0, 3) for a mesh without area."""
    area = np.cumsum(mesh.area_faces)
    if len(area) == 0 or not area[-1] > 0:
        return np.zeros((0, 3))
    face = np.searchsorted(area, rng.uniform(0, area[-1], count), side="right")
    # The square root makes barycentric draws uniform (Osada et al. 2002).
    root, second = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.column_stack([1 - root, root * (1 - second), root * second])
    corners = mesh.triangles[np.minimum(face, len(area) - 1)]
    return np.einsum("nc,ncd->nd", weights, corners)


def nearest_distances(points: Points, others: Points) -> NDArray[np.float64]:
    """Distance (n,) from each of `points` (n, 3) to the nearest of `others` (m, 3)."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(others).query(points)
    return np.asarray(distance, dtype=np.float64)


def chamfer(points_a: Points, points_b: Points) -> float:
    """Mean nearest distance from a to b plus mean nearest distance from b to a, metres.

    points_a : (n, 3), points_b : (m, 3), metres. NaN if either is empty.
    """
    if len(points_a) == 0 or len(points_b) == 0:
        return float("nan")
    forth = nearest_distances(points_a, points_b).mean()
    back = nearest_distances(points_b, points_a).mean()
    return float(forth + back)


def f_score(predicted: Points, true: Points, threshold: float = 0.01) -> float:
    """Harmonic mean of precision and recall of surface points within `threshold` metres.

    predicted : (n, 3), true : (m, 3). 0 if either is empty (Tatarchenko et al., CVPR 2019).
    """
    if len(predicted) == 0 or len(true) == 0:
        return 0.0
    forth, back = nearest_distances(predicted, true), nearest_distances(true, predicted)
    return f_score_of_distances(forth, back, threshold)


def f_score_of_distances(forth: Points, back: Points, threshold: float) -> float:
    """The same of distances (n,) from the prediction to the truth, and (m,) back, metres."""
    precision, recall = float(np.mean(forth <= threshold)), float(np.mean(back <= threshold))
    total = precision + recall
    return 2 * precision * recall / total if total > 0 else 0.0
