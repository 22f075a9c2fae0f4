"""Is the printed uncertainty of a surface what its errors are? On scenes with known truth.

    python tools/measure_uncertainty.py made/stereo --prior prior/ --data-root data/ -o rows.jsonl
    python tools/measure_uncertainty.py --report rows.jsonl

Points are drawn uniformly by area from every written mesh. Each has the standard deviation that is
printed at it (interpolated between the vertices of its face), its true distance to the exact mesh,
and whether the camera saw it: whether its ray meets the mesh there first, at a pixel of the
object's mask. The report has each set as a whole, and all of them together in bins of the printed
deviation, each object counting alike; `ratio` is the root mean square of the true distances over
that of the printed deviations, 1 if they are honest; `within 2` is the share of points nearer to
the truth than two printed deviations (95 % of a normal distribution). Recognised objects and
completed ones stand apart, seen and unseen sides too.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.api import reconstruct
from brrp_cli.config import preset
from brrp_cli.errors import BrrpError
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import at_pixels
from brrp_cli.ground_truth.scenes import Scene, find_scenes, true_mesh_in_camera
from brrp_cli.ground_truth.surface_metrics import MeshSurface
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.reconstruction import METRES, ObjectReconstruction
from brrp_cli.seeds import child_rng

POINTS = 400
MIN_PIXELS = 200
# Upper ends of the bins of the printed deviation, metres.
EDGES = (0.001, 0.0015, 0.002, 0.003, 0.004, 0.006, 0.01, np.inf)
# Bins with a smaller share of the points are left out.
LEAST_SHARE = 0.02


@one_message()
def main() -> None:
    """Measure, or report what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", type=Path, nargs="*", help="folders; their names stand in rows")
    parser.add_argument("--prior", type=Path)
    parser.add_argument("--data-root", type=Path)
    parser.add_argument("--first", type=int, default=10, help="scenes of each folder")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--report", type=Path)
    arguments = parser.parse_args()
    if arguments.report is not None:
        rows = [json.loads(line) for line in arguments.report.read_text().splitlines()]
        print("\n".join(report(rows)))
        return
    prior = open_prior(arguments.prior)
    with arguments.output.open("a") as file:
        for folder in arguments.scenes:
            for scene in find_scenes(folder, slice(0, arguments.first)):
                for row in measure(scene, prior, arguments.data_root):
                    file.write(json.dumps({"set": folder.name, **row}) + "\n")
                file.flush()
                print(folder.name, scene.name, file=sys.stderr)


def measure(scene: Scene, prior: Prior, data_root: Path | None) -> Iterator[dict[str, Any]]:
    """A row for each mesh of the scene's first view."""
    frame = scene.view(0)
    result = reconstruct(frame, prior, config=preset("default"), device="cpu", workers=1)
    for item in result.objects:
        if int((frame.segmap == item.object_id).sum()) < MIN_PIXELS or item.surface is None:
            continue
        true = scene.object(item.object_id)
        assert frame.T_world_cam is not None
        try:
            mesh = true_mesh_in_camera(true, data_root, frame.T_world_cam)
        except BrrpError as error:
            print(f"{scene.name}: {error}", file=sys.stderr)
            continue
        taken = item.recognised
        yield {
            "scene": scene.name,
            "object": true.name,
            "taken_for": None if taken is None else taken.name,
            **points_of(item, frame, MeshSurface(mesh), scene.name),
        }


def points_of(
    item: ObjectReconstruction, frame: Frame, truth: MeshSurface, name: str
) -> dict[str, list[float]]:
    """printed, true : metres; seen : 0 or 1; of `POINTS` points of the written mesh."""
    surface = item.surface
    assert surface is not None and surface.uncertainty_unit == METRES
    mesh = surface.as_trimesh()
    rng = child_rng(0, "uncertainty", name, item.object_id)
    weights = mesh.area_faces / mesh.area_faces.sum()
    faces = surface.faces[rng.choice(len(weights), POINTS, p=weights)]
    share = rng.dirichlet(np.ones(3), POINTS)  # uniform within a triangle
    points = np.einsum("nk,nki->ni", share, surface.vertices[faces])
    printed = np.einsum("nk,nk->n", share, surface.uncertainty[faces])
    first = MeshSurface(mesh).reached_from(np.zeros(3), points)
    seen = first & (at_pixels(points, frame.segmap, frame) == item.object_id)
    distance = truth.nearest(points).distance
    return {
        "printed": np.round(printed, 5).tolist(),
        "true": np.round(distance, 5).tolist(),
        "seen": seen.astype(int).tolist(),
    }


def report(rows: list[dict[str, Any]]) -> list[str]:
    """Markdown: each set as a whole, and all sets together in bins of the printed deviation."""
    lines = [*_head("set")]
    for name in sorted({row["set"] for row in rows}):
        for kind, side, points in _kinds([row for row in rows if row["set"] == name]):
            lines.append(_line([name, kind, side], points, points))
    lines += ["", *_head("printed (mm)")]
    for kind, side, points in _kinds(rows):
        bins = np.searchsorted(EDGES, points[:, 0])
        for number, end in enumerate(EDGES):
            chosen = points[bins == number]
            if len(chosen) < LEAST_SHARE * len(points):
                continue
            start = 0.0 if number == 0 else EDGES[number - 1]
            span = f"{1000 * start:g} to {1000 * end:g}"
            lines.append(_line([span, kind, side], chosen, points))
    return lines


def _kinds(rows: list[dict[str, Any]]) -> Iterator[tuple[str, str, NDArray[np.float64]]]:
    """Kind, with the number of objects, side, and points (n, 2), printed and true, metres."""
    for kind in ("recognised", "completed"):
        chosen = [row for row in rows if (row["taken_for"] is None) == (kind == "completed")]
        if not chosen:
            continue
        printed, true, seen = (
            np.concatenate([row[key] for row in chosen]) for key in ("printed", "true", "seen")
        )
        for side, wanted in (("seen", 1), ("unseen", 0)):
            points = np.stack([printed, true], axis=1)[seen == wanted]
            if len(points):
                yield f"{kind} ({len(chosen)})", side, points


def _head(first: str) -> list[str]:
    return [
        f"| {first} | objects | side | points (%) | printed, mean (mm) | true, RMS (mm) | ratio"
        " | within 2 (%) |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]


def _line(names: list[str], points: NDArray[np.float64], of: NDArray[np.float64]) -> str:
    """What these points (n, 2) say, a share of all `of` (m, 2)."""
    sigma, error = points.T
    root = np.sqrt(np.mean(points**2, axis=0))
    numbers = [
        f"{100 * len(points) / len(of):.0f}",
        f"{1000 * sigma.mean():.1f}",
        f"{1000 * root[1]:.1f}",
        f"{root[1] / root[0]:.2f}",
        f"{100 * np.mean(error < 2 * sigma):.0f}",
    ]
    return f"| {' | '.join(names + numbers)} |"


if __name__ == "__main__":
    main()
