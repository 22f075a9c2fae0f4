"""How often true objects lie inside the surfaces of `--confidence`, on scenes with known truth.

    python tools/measure_confidence.py scenes/ --prior prior/ --data-root data/ -o coverage.jsonl
    python tools/measure_confidence.py --report coverage.jsonl

One line for each object, written as soon as it is known; a second run goes on where the first was
stopped. For each confidence: whether every one of 4,000 points of the true surface lies inside, the
share of them that does, how far the worst lies outside, how far inside they lie on average
(growth), and the same for the region that holds for each point alone, {p >= 1 - confidence}.
"""

from __future__ import annotations

import argparse
import json
import sys
from functools import partial
from pathlib import Path

import numpy as np
import trimesh

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.api import reconstruct
from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.config import MeanConfig, preset
from brrp_cli.dependencies import import_library, import_open3d
from brrp_cli.ground_truth.metrics import sample_surface
from brrp_cli.ground_truth.scenes import find_scenes, true_mesh_in_camera
from brrp_cli.methods.registry import METHODS
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.raycast import surface_scene
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.seeds import child_rng
from brrp_cli.surface.around_guess import Free
from brrp_cli.surface.confidence import Empty, confidence_surface
from brrp_cli.surface.free_space import free_balls

CONFIDENCES = (0.5, 0.8, 0.9, 0.95, 0.99)
POINTS = 4_000
MIN_PIXELS = 200


@one_message()
def main() -> None:
    """Measure, or report what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", type=Path, nargs="?")
    parser.add_argument("--prior", type=Path)
    parser.add_argument("--data-root", type=Path)
    parser.add_argument("--method", default="brrp")
    parser.add_argument("--preset")
    parser.add_argument("--margin", type=float, default=0.0, help="mm, into unseen space")
    parser.add_argument("--first", type=int, default=10, help="scenes")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--report", type=Path)
    arguments = parser.parse_args()
    if arguments.report is not None:
        report([json.loads(line) for line in arguments.report.read_text().splitlines()])
        return
    measure(arguments)


def measure(arguments: argparse.Namespace) -> None:
    """Append the rows of the scenes that the file does not hold yet."""
    prior = None if arguments.prior is None else open_prior(arguments.prior)
    done = set()
    if arguments.output.exists():
        done = {json.loads(line)["scene"] for line in arguments.output.read_text().splitlines()}
    for scene in find_scenes(arguments.scenes, slice(0, arguments.first)):
        if scene.name in done:
            continue
        frame = scene.view(0)
        config = METHODS[arguments.method].preset(arguments.preset)
        result = reconstruct(frame, prior, method=arguments.method, config=config, device="cpu")
        rows = []
        for item in result.objects:
            pixels = int((frame.segmap == item.object_id).sum())
            if pixels < MIN_PIXELS:
                continue
            true = scene.object(item.object_id)
            mesh = true_mesh_in_camera(true, arguments.data_root, frame.T_world_cam)
            rng = child_rng(0, "coverage", scene.name, item.object_id)
            surface = np.asarray(sample_surface(mesh, POINTS, rng))
            empty = partial(_empty, result, item.object_id)
            free = partial(free_balls, frame=result.frame, plane=result.plane, config=MeanConfig())
            rows.append(
                {
                    "scene": scene.name,
                    "id": item.object_id,
                    "name": true.name,
                    "pixels": pixels,
                    "stored": _stored(prior, true.name),
                    "status": item.status,
                    "unknown_weight": item.unknown_weight,
                    "found": _coverage(item, surface, arguments.margin / 1000, empty, free),
                }
            )
        with arguments.output.open("a") as stream:
            stream.writelines(json.dumps(row) + "\n" for row in rows)
        print(scene.name, len(rows), flush=True)


def _stored(prior: Prior | None, name: str) -> bool:
    return prior is not None and name in prior.names


def _coverage(
    item: ObjectReconstruction, points: np.ndarray, margin: float, empty: Empty, free: Free
) -> list[dict[str, float]]:
    """A row for each confidence; empty without a posterior."""
    if item.posterior is None or item.observed is None:
        return []
    config = preset("default").surface
    p = item.posterior.probability(points)
    rows = []
    for confidence in CONFIDENCES:
        region = confidence_surface(
            item.posterior, item.observed, confidence, config, margin, empty, free
        )
        if region is None:
            continue
        outside = _outside(region.vertices, region.faces, points)
        mesh = trimesh.Trimesh(region.vertices, region.faces, process=False)
        rows.append(
            {
                "confidence": confidence,
                "level": region.level,
                "share": float((outside <= 0).mean()),
                "worst": float(outside.max()),
                "share_each_point": float((p >= 1 - confidence).mean()),
                "litre": float(mesh.volume) * 1000,
                "growth": float(-outside.mean()),
            }
        )
    return rows


def _empty(result: Reconstruction, object_id: int, points: np.ndarray) -> np.ndarray:
    """Which points (n, 3), camera frame, were seen to be empty."""
    return empty_space(points, result.frame, object_id, result.plane, MeanConfig())


def _outside(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distance (n,), metres, of points to a closed mesh; positive outside.

    A grown mesh may run into itself, between the jaws of a clamp. Inside is where it winds around a
    point once or more: counting crossings would take what lies inside of it twice for outside.
    """
    pcu = import_library("point_cloud_utils")
    o3d = import_open3d()
    center = vertices.mean(axis=0)
    scene = surface_scene(vertices - center, faces, threads=0)
    query = o3d.core.Tensor((points - center).astype(np.float32))
    distance = scene.compute_distance(query).numpy()
    winds = pcu.triangle_soup_fast_winding_number(
        np.asarray(vertices - center, np.float64),
        np.asarray(faces, np.int64),
        np.asarray(points - center, np.float64),
    )
    return np.where(winds > 0.5, -distance, distance)


def report(rows: list[dict]) -> None:
    """Shares by what the object is and what it was taken for."""
    groups = {
        "all": rows,
        "stored, taken for a stored one": [
            r for r in rows if r["stored"] and (r["unknown_weight"] or 0) < 0.5
        ],
        "stored, taken for none": [
            r for r in rows if r["stored"] and (r["unknown_weight"] or 0) >= 0.5
        ],
        "not stored": [r for r in rows if not r["stored"]],
    }
    for name, group in groups.items():
        with_posterior = [r for r in group if r["found"]]
        if not with_posterior:
            continue
        print(f"{name}: {len(group)} objects, {len(group) - len(with_posterior)} without a surface")
        print(
            "  confidence   whole   but 1 %   within 5 mm   points   points, each alone   litre"
            "   growth, mm"
        )
        for confidence in CONFIDENCES:
            found = [f for r in with_posterior for f in r["found"] if f["confidence"] == confidence]
            share = np.array([f["share"] for f in found])
            worst = np.array([f["worst"] for f in found])
            print(
                f"  {confidence:<10} {(share == 1).mean():8.3f} {(share >= 0.99).mean():9.3f} "
                f"{(worst < 0.005).mean():13.3f} {share.mean():8.3f} "
                f"{np.mean([f['share_each_point'] for f in found]):20.3f} "
                f"{np.mean([f['litre'] for f in found]):7.2f} "
                f"{1000 * np.mean([f['growth'] for f in found]):12.2f}"
            )


if __name__ == "__main__":
    main()
