"""Score the meshes of a folder of results against the truth of the view that they are of.

    python tools/score_results.py OUT/ --truth SCENE/VIEW --data-root DATA [-o scores.csv]

OUT holds `object_ID.ply`, as `brrp reconstruct` writes them; ID is the object's value in the masks
of the view. Any other program's meshes serve too: metres, in the camera frame (x right, y down, z
forward), or in the world's with `--frame world`; result.json, where there is one, tells which.
The truth is a view of the published layout (SCENE/0000), or NAME.npz with NAME.truth.json beside
it.

One line for each object with at least 16 pixels in the view, and means; the metrics and their
points are those of `brrp eval` (see score_surface in brrp_cli/ground_truth/surface_metrics.py). An
object without a mesh has F-scores of 0 and no distance.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.evaluation.evaluate_scene import MIN_PIXELS
from brrp_cli.frames.frame import Frame
from brrp_cli.ground_truth.scenes import Scene, find_scenes
from brrp_cli.ground_truth.surface_metrics import score_written, true_surface
from brrp_cli.ground_truth.true_meshes import exact_truth, truth_cache

Row = dict[str, Any]

PRINTED = (
    ("distance mm", "surface_distance", 1000, 2),
    ("F 2 mm", "f_score_2mm", 1, 3),
    ("F 5 mm", "f_score_5mm", 1, 3),
    ("F 10 mm", "f_score_10mm", 1, 3),
    ("volume", "volume_ratio", 1, 2),
    ("closed", "watertight", 1, 2),
    ("pieces", "pieces", 1, 2),
    ("normals", "normal_consistency", 1, 3),
    ("seen mm", "surface_distance_seen", 1000, 2),
    ("unseen mm", "surface_distance_unseen", 1000, 2),
    ("bias mm", "surface_bias", 1000, 2),
)


@one_message()
def main() -> None:
    """Score one folder."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("--truth", type=Path, required=True, help="SCENE/VIEW or NAME.npz")
    parser.add_argument("--data-root", type=Path, required=True)
    parser.add_argument("--frame", choices=["camera", "world"], help="of the meshes")
    parser.add_argument("-o", "--output", type=Path, help="all metrics as CSV, metres")
    arguments = parser.parse_args()
    scene, view = find_view(arguments.truth)
    T_cam_mesh = mesh_to_camera(arguments.results, scene.view(view), arguments.frame)
    rows = score_folder(arguments.results, T_cam_mesh, scene, view, arguments.data_root)
    print(printed(rows))
    if arguments.output is not None:
        with arguments.output.open("w", newline="") as stream:
            writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


def find_view(path: Path) -> tuple[Scene, int]:
    """The scene of a view, and the view's number. Errors: SceneError."""
    inside = path.is_dir() and not (path / "objects.json").is_file()
    (scene,) = find_scenes(path.parent if inside else path)
    names = [view.name for view in scene.views]
    return scene, names.index(path.name) if inside and path.name in names else 0


def mesh_to_camera(results: Path, frame: Frame, name: str | None) -> np.ndarray:
    """(4, 4) from the frame of the meshes to the camera's."""
    record = results / "result.json"
    if name is None and record.is_file():
        return np.linalg.inv(json.loads(record.read_text())["T_frame_cam"])
    assert frame.T_world_cam is not None
    return np.linalg.inv(frame.T_world_cam) if name == "world" else np.eye(4)


def score_folder(
    results: Path, T_cam_mesh: np.ndarray, scene: Scene, view: int, data_root: Path, seed: int = 0
) -> list[Row]:
    """A row for each true object that the view shows. Errors: BrrpError."""
    frame = scene.view(view)
    assert frame.T_world_cam is not None
    T_cam_world = np.linalg.inv(frame.T_world_cam)
    rows = []
    for object_id in frame.object_ids:
        if np.count_nonzero(frame.segmap == object_id) < MIN_PIXELS:
            continue
        exact = exact_truth(scene.object(object_id), data_root, truth_cache()).moved(T_cam_world)
        truth = true_surface(exact, frame, object_id, scene.name, seed)
        path = results / f"object_{object_id}.ply"
        mesh = read_mesh(path).apply_transform(T_cam_mesh) if path.is_file() else None
        rows.append(
            {
                "object_id": object_id,
                "name": scene.object(object_id).name,
                "thickness_class": truth.thickness_class,
                **score_written(mesh, truth, scene.name, seed),
            }
        )
    return rows


def read_mesh(path: Path) -> trimesh.Trimesh:
    """The mesh as it is; vertices of equal place are one where that is what closes it."""
    mesh = trimesh.load_mesh(path, process=False)
    if not mesh.is_watertight:
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh


def printed(rows: list[Row]) -> str:
    """A table of objects and, last, the means of the values that are there."""
    means: Row = {"name": f"mean of {len(rows)}", "thickness_class": ""}
    for _, name, *_ in PRINTED:
        there = [row[name] for row in rows if not math.isnan(row[name])]
        means[name] = float(np.mean(there)) if there else math.nan
    width = max(len(row["name"]) for row in [*rows, means])
    lines = [" ".join([" " * width, " " * 5, *(f"{heading:>11}" for heading, *_ in PRINTED)])]
    for row in [*rows, means]:
        values = (f"{row[name] * factor:11.{digits}f}" for _, name, factor, digits in PRINTED)
        lines.append(" ".join([f"{row['name']:<{width}}", f"{row['thickness_class']:<5}", *values]))
    without = sum(math.isnan(row["surface_distance"]) for row in rows)
    return "\n".join([*lines, f"{without} of {len(rows)} objects without a mesh"])


if __name__ == "__main__":
    main()
