"""All metrics of one reconstructed object against the true one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.evaluation.calibration import (
    ause,
    brier,
    negative_log_likelihood,
    reliability,
)
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.ground_truth.metrics import chamfer, f_score, iou, sample_surface
from brrp_cli.ground_truth.true_shape import FINE, TrueShape
from brrp_cli.reconstruction import OccupancyPosterior, Retrieved

if TYPE_CHECKING:
    import trimesh

    from brrp_cli.prior.objects import PriorObject

LEVEL = 0.5
BINS = 15
REGIONS = ("near", "occluded")
SHAPE_METRICS = ("iou", "chamfer", "iou_exact", "chamfer_exact", "iou_5mm", "f_score_1cm")
PROBABILITY_METRICS = ("brier", "nll", "ause", "ause_entropy")


def score_shape(
    posterior: OccupancyPosterior,
    truth: TrueShape,
    rng: np.random.Generator,
    level: float = LEVEL,
) -> dict[str, float]:
    """`SHAPE_METRICS`, lengths in metres; a Chamfer distance is NaN if nothing is occupied.

    level : occupancy at the method's surface

    iou, chamfer : as the published tables take them; *_exact : the same against the mesh that was
    not thickened; iou_5mm, f_score_1cm : on the fine grid, against that mesh too.
    """
    probability = posterior.probability(truth.grid)
    side = round(len(truth.grid) ** (1 / 3))
    occupied = probability > level
    count = len(truth.closed_surface)
    volume = probability.reshape(side, side, side)
    coarse = _surface_points(volume, truth.T_cam_grid, level, count, rng)
    fine = posterior.probability_volume(truth.fine)
    T_cam_fine = similarity(FINE, translation=np.array([axis[0] for axis in truth.fine]))
    return {
        "iou": iou(occupied, truth.closed),
        "chamfer": chamfer(coarse, truth.closed_surface),
        "iou_exact": iou(occupied, truth.exact),
        "chamfer_exact": chamfer(coarse, truth.exact_surface),
        "iou_5mm": iou(fine > level, truth.fine_exact),
        "f_score_1cm": f_score(
            _surface_points(fine, T_cam_fine, level, count, rng), truth.exact_surface
        ),
    }


def score_probabilities(
    posterior: OccupancyPosterior, truth: TrueShape
) -> tuple[dict[str, float], dict[str, list[list[float]]]]:
    """Brier score, negative log likelihood and AUSE near the object, over all points and over the
    occluded ones alone; and for each of the two regions the sums of a reliability diagram.

    The error that uncertainty is to rank is the squared difference of probability and truth; `ause`
    ranks by the method's own uncertainty, `ause_entropy` by how close the probability is to 0.5. A
    diagram is three lists over 15 bins: points, sum of their probabilities, occupied points.
    """
    probability = posterior.probability(truth.near)
    uncertainty = posterior.uncertainty(truth.near)
    error = (probability.astype(np.float64) - truth.near_exact) ** 2
    scores: dict[str, float] = {}
    diagrams: dict[str, list[list[float]]] = {}
    for region, chosen in zip(
        REGIONS, (np.ones(len(truth.near), dtype=bool), truth.occluded), strict=True
    ):
        p, y = probability[chosen], truth.near_exact[chosen]
        scores[f"brier_{region}"] = brier(p, y)
        scores[f"nll_{region}"] = negative_log_likelihood(p, y)
        scores[f"ause_{region}"] = ause(error[chosen], uncertainty[chosen])
        scores[f"ause_entropy_{region}"] = ause(error[chosen], (p * (1 - p)).astype(np.float64))
        diagrams[region] = reliability_sums(p, y)
    return scores, diagrams


def reliability_sums(
    probability: NDArray[np.floating], label: NDArray[np.bool_]
) -> list[list[float]]:
    """Points, sum of probabilities and positive labels in each of 15 bins. Sums of such sums over
    objects are those of all their points."""
    found = reliability(probability, label, BINS)
    sums = (found.count, found.count * found.confidence, found.count * found.frequency)
    return [np.nan_to_num(each).tolist() for each in sums]


def placement_error(placed: Retrieved, stored: PriorObject, truth: TrueShape) -> float:
    """Mean distance in metres from the placed model's surface to the true one."""
    from brrp_cli.dependencies import import_open3d
    from brrp_cli.raycast import raycasting_scene

    assert placed.T_cam_object is not None
    o3d = import_open3d()
    model = transform_points(placed.T_cam_object, stored.surface.astype(np.float64))
    # Distances are float32: far from the origin they would lose a tenth of a millimetre.
    center = truth.mesh.exact.bounds.mean(axis=0)
    mesh = truth.mesh.exact.copy()
    mesh.apply_translation(-center)
    query = o3d.core.Tensor(np.ascontiguousarray(model - center, dtype=np.float32))
    return float(raycasting_scene([mesh]).compute_distance(query).numpy().mean(dtype=np.float64))


def isosurface(
    volume: NDArray[np.floating], T_target_grid: NDArray[np.floating], level: float = LEVEL
) -> trimesh.Trimesh | None:
    """Marching cubes at `level` on a volume (nx, ny, nz); vertices in the target frame. None if no
    surface passes through the volume."""
    import trimesh
    from skimage.measure import marching_cubes

    if not volume.min() < level < volume.max():
        return None
    vertices, faces, _, _ = marching_cubes(volume, level, gradient_direction="ascent")
    return trimesh.Trimesh(
        transform_points(T_target_grid, vertices.astype(np.float64)), faces, process=False
    )


def _surface_points(
    volume: NDArray[np.floating],
    T_cam_grid: NDArray[np.floating],
    level: float,
    count: int,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Points (count, 3) of the level set; (0, 3) if there is none."""
    mesh = isosurface(volume, T_cam_grid, level)
    return np.zeros((0, 3)) if mesh is None else sample_surface(mesh, count, rng)
