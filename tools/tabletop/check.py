"""Does what was written fit together? Back-projected pixels must lie on the posed meshes.

Back-projection here follows the layout's own words (normalised device coordinates through the
inverse of projection x view), not the project's frame reader, so that one checks the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.errors import SceneError
from brrp_cli.ground_truth.truth import read_objects, true_mesh
from brrp_cli.raycast import surface_scene

MAX_PIXELS = 2000  # of one object; more would only take longer
MIN_PIXELS = 16
# Median and 95th percentile of the distance to the mesh, metres, that are taken as right.
CLEAN = (0.001, 0.003)
# A camera that bleeds over silhouettes shows what lies behind, however far, at an object's border,
# and of what is thin or a sliver nothing else: of a scene half of the larger objects are judged.
SENSOR = 0.02
SENSOR_PIXELS = 1000
STRUCTURED_LIGHT = (0.0025, 0.01)  # 1.5 and 5.5 mm is the worst of 748 objects


@dataclass(frozen=True)
class Distance:
    """How far one object's pixels lie from its posed mesh in one view, metres."""

    view: Path
    object_id: int
    pixels: int
    median: float
    percentile95: float


def check_scene(
    folder: Path,
    data_root: Path,
    limits: tuple[float, float] = CLEAN,
) -> list[Distance]:
    """Check each view of a scene folder.

    Errors: SceneError if a mask holds an id that objects.json lacks, or if an object's pixels lie
    further from its mesh than `limits` (median, 95th percentile), metres. Objects with fewer than
    `MIN_PIXELS` pixels are not looked at.
    """
    objects = {o.id: o for o in read_objects(folder / "objects.json")}
    surfaces: dict[int, Any] = {}
    distances = []
    for view in sorted(path for path in folder.iterdir() if path.is_dir()):
        points, ids = world_points(view)
        for object_id in np.unique(ids[ids != 0]).tolist():
            if object_id not in objects:
                raise SceneError(
                    "The mask has an id that is no object's",
                    where=view / "seg_mask.npy",
                    expected=f"0 or one of {sorted(objects)}",
                    found=object_id,
                )
            seen = points[(ids == object_id) & np.isfinite(points).all(axis=-1)]
            if len(seen) < MIN_PIXELS:
                continue
            if object_id not in surfaces:
                mesh = true_mesh(objects[object_id], data_root)
                surfaces[object_id] = surface_scene(mesh.vertices, mesh.faces, threads=0)
            distance = _distances(surfaces[object_id], seen[:: -(-len(seen) // MAX_PIXELS)])
            median, high = np.percentile(distance, [50, 95])
            distances.append(Distance(view, object_id, len(seen), float(median), float(high)))
            if median > limits[0] or high > limits[1]:
                raise SceneError(
                    "Pixels do not lie on the posed mesh",
                    where=f"{view}, object {object_id} ({objects[object_id].mesh_path})",
                    expected=f"median < {limits[0] * 1000:g} mm, 95 % < {limits[1] * 1000:g} mm",
                    found=f"median {median * 1000:.2f} mm, 95 % {high * 1000:.2f} mm",
                )
    return distances


def check_measured_scene(folder: Path, data_root: Path) -> list[Distance]:
    """`check_scene` of depth that a camera's errors are in.

    Errors: SceneError if half of the objects of `SENSOR_PIXELS` lie further from their meshes than
    `SENSOR`.
    """
    distances = check_scene(folder, data_root, (np.inf, np.inf))
    large = [each.median for each in distances if each.pixels >= SENSOR_PIXELS]
    if large and np.median(large) > SENSOR:
        raise SceneError(
            "Pixels do not lie on the posed meshes",
            where=folder,
            expected=f"median < {SENSOR * 1000:g} mm for half of the objects",
            found=f"{np.median(large) * 1000:.2f} mm",
        )
    return distances


def world_points(view: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """World points (H, W, 3) of a view, NaN without return, and the ids (H, W)."""
    depth, ids = np.load(view / "depth.npy"), np.load(view / "seg_mask.npy")
    with np.load(view / "camera.npz") as camera:
        clip_from_world = camera["projection_matrix"] @ camera["view_matrix"]
    height, width = depth.shape
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    ndc = np.stack(
        [-1 + 2 * u / width, 1 - 2 * v / height, 2.0 * depth - 1, np.ones(depth.shape)], axis=-1
    )
    world = ndc @ np.linalg.inv(clip_from_world).T
    points = world[..., :3] / world[..., 3:]
    points[depth >= 1] = np.nan
    return points, ids.astype(np.int64)


def _distances(surface: Any, points: NDArray[np.float64]) -> NDArray[np.float32]:
    o3d = import_open3d()
    query = o3d.core.Tensor(points.astype(np.float32))
    return np.asarray(surface.compute_distance(query).numpy())
