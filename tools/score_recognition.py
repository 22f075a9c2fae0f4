"""Which stored objects are recognised with masks made from depth, and what became of the others?

    python tools/score_recognition.py SCENES... --prior PRIOR --data-root DATA [-o rows.jsonl]

For each set of scenes (published layout, as tools/make_scenes.py writes it), over the true objects
that the prior holds, of which the first view has 1,000 pixels of depth or more and which the
image's border does not cut: how many are recognised after masks were mended, by what the mask was
before that. Of a frame in which nothing is found all are missing. Those that the border cuts have a
line of their own. --truth takes the true masks instead.

own      a mask of its own, IoU over 0.75
shared   its mask holds another object, too: a quarter of the mask, or 40 % of that object
pieces   two masks or more hold mostly it, each a tenth of it
table    a quarter of its mask is table or what lies behind
part     less than 70 % of it has a mask
rough    its own for the rest, IoU 0.75 or less
missing  no mask holds 30 % of it

`wrong` counts masks that were taken for a stored object, weight over 0.5, that most of the mask is
not; `pixels` of such masks are in the rows. `mm` is the mean distance of placed models, where
they are recognised, from the true surface. The last line holds the weights of all masks that were
taken for a stored object against how many of them are right: the expected calibration error (ECE),
and the masks and those that are right between the weights of WEIGHTS.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from shown_object import shown_object

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.errors import BrrpError, FrameError
from brrp_cli.evaluation.bootstrap import mean_interval
from brrp_cli.evaluation.calibration import expected_calibration_error
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.ground_truth.scenes import Scene, find_scenes, true_mesh_in_camera
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.raycast import raycasting_scene
from brrp_cli.reconstruction import Retrieved
from brrp_cli.segmentation.left_out import border_share
from brrp_cli.segmentation.segment import segment_and_aside
from brrp_cli.session import Reconstructor

# Edges of the bins in which weights are held against what is right.
WEIGHTS = (0.5, 0.8, 0.95, 1.0)
CAUSES = ("own", "shared", "pieces", "table", "part", "rough", "missing")

Row = dict[str, Any]


def cause(truth: np.ndarray, masks: np.ndarray, object_id: int) -> tuple[str, list[int]]:
    """What became of one object's mask, and the objects with which it shares one.

    truth, masks : (n,) ids of the same pixels, 0 = background
    """
    own = truth == object_id
    ids, counts = np.unique(masks[own & (masks != 0)], return_counts=True)
    if not len(ids) or counts.max() < 0.3 * own.sum():
        pieces = [i for i in ids if _holds_mostly(truth, masks == i, object_id)]
        return ("pieces" if len(pieces) > 1 else "missing"), []
    mask = masks == ids[np.argmax(counts)]
    if (mask & own).sum() > 0.75 * (mask | own).sum():
        return "own", []
    sharing = [
        int(other)
        for other in np.unique(truth[mask])
        if other not in (0, object_id)
        and (part := (truth[mask] == other).sum())
        > min(0.25 * mask.sum(), 0.4 * (truth == other).sum())
        and part > 0.05 * mask.sum()
    ]
    if sharing:
        return "shared", sharing
    pieces = [
        i
        for i, count in zip(ids, counts, strict=True)
        if count > 0.1 * own.sum() and _holds_mostly(truth, masks == i, object_id)
    ]
    if len(pieces) > 1:
        return "pieces", []
    if (truth[mask] == 0).sum() > 0.25 * mask.sum():
        return "table", []
    if (own & (masks != 0)).sum() < 0.7 * own.sum():
        return "part", []
    return "rough", []


def _holds_mostly(truth: np.ndarray, mask: np.ndarray, object_id: int) -> bool:
    return bool((truth[mask] == object_id).sum() > 0.5 * mask.sum())


def rows_of(
    scene: Scene, again: Reconstructor, prior: Prior, data_root: Path, given: bool, least: int
) -> list[Row]:
    """A row for each object that the prior holds, and one for each mask taken for one."""
    frame = scene.view(0)
    start = time.perf_counter()
    masks, seconds = frame.segmap, 0.0
    nothing = np.zeros_like(masks)
    try:
        if not given:
            masks = nothing
            masks = segment_and_aside(frame)[0]
            seconds = time.perf_counter() - start
        result = again(frame if given else replace(frame, segmap=nothing))
        mended, items = result.frame.segmap, result.objects
    except FrameError as error:
        print(f"{scene.name}: {error}", file=sys.stderr)
        mended, items = nothing, []
    told = {item.object_id: shown_object(mended == item.object_id, frame) for item in items}
    rows: list[Row] = []
    for object_id in frame.object_ids:
        name = scene.object(object_id).name
        mine = frame.segmap == object_id
        cut = border_share(mine) > SegmentConfig().left_out.cut
        if name not in prior.names or (mine & frame.valid).sum() < least:
            continue
        why, others = cause(frame.segmap[frame.valid], masks[frame.valid], object_id)
        found = [
            item.recognised
            for item in items
            if item.recognised is not None
            and item.recognised.name == name
            and told[item.object_id] == object_id
        ]
        rows.append(
            {
                "scene": scene.name,
                "object": name,
                "pixels": int((mine & frame.valid).sum()),
                "cause": why,
                "cut": cut,
                "shared_with": [scene.object(i).name for i in others],
                "recognised": bool(found),
                "distance": _distance(found[0], scene, object_id, prior, data_root, frame)
                if found
                else None,
                "seconds": seconds,
            }
        )
    for item in items:
        if (taken := item.recognised) is None:
            continue
        true_id = told[item.object_id]
        true_name = scene.object(true_id).name if true_id else "nothing"
        rows.append(
            {
                "scene": scene.name,
                "taken": taken.name,
                "weight": taken.weight,
                "is": true_name,
                "stored": true_name in prior.names,
                "pixels": int((mended == item.object_id).sum()),
            }
        )
    rows.append({"scene": scene.name, "masks": len(items)})
    return rows


def _distance(
    found: Retrieved, scene: Scene, object_id: int, prior: Prior, data_root: Path, frame: Frame
) -> float:
    """Mean distance, metres, of the placed model's vertices from the true surface."""
    assert frame.T_world_cam is not None
    assert found.T_cam_object is not None
    mesh = true_mesh_in_camera(scene.object(object_id), data_root, frame.T_world_cam).copy()
    center = mesh.bounds.mean(axis=0)
    mesh.apply_translation(-center)
    vertices = prior.load(found.name).shape.vertices.astype(np.float64)
    drawn = vertices[np.random.default_rng(0).permutation(len(vertices))[:2000]]
    placed = transform_points(found.T_cam_object, drawn) - center
    query = import_open3d().core.Tensor(placed.astype(np.float32))
    return float(raycasting_scene([mesh]).compute_distance(query).numpy().mean())


def share_of(objects: list[Row]) -> str:
    """The share of recognised objects, with its 95 % interval over scenes."""
    if not objects:
        return ""
    scenes = [f"{row.get('set', '')}/{row['scene']}" for row in objects]
    recognised = [float(row["recognised"]) for row in objects]
    found = mean_interval(recognised, scenes, np.random.default_rng(0))
    return f" ({100 * found.value:.0f} % [{100 * found.low:.0f}, {100 * found.high:.0f}])"


def report(name: str, rows: list[Row]) -> str:
    """Lines of one set: all, and by cause."""
    every = [row for row in rows if "object" in row]
    objects, cut = [row for row in every if not row["cut"]], [row for row in every if row["cut"]]
    taken = [row for row in rows if "taken" in row]
    wrong = [row for row in taken if row["taken"] != row["is"]]
    masks = sum(row["masks"] for row in rows if "masks" in row)
    found = [row for row in objects if row["recognised"]]
    near = 1000 * np.mean([row["distance"] for row in found]) if found else np.nan
    lines = [
        f"{name}: {len(found)} of {len(objects)} recognised{share_of(objects)}, {near:.1f} mm;"
        f" {len(wrong)} of {masks} masks wrong"
    ]
    for why in CAUSES:
        those = [row for row in objects if row["cause"] == why]
        if those:
            lines.append(
                f"  {why:8} {len(those):4}, recognised {sum(r['recognised'] for r in those):4}"
            )
    if cut:
        many = sum(row["recognised"] for row in cut)
        lines.append(f"  cut by the border {len(cut):4}, recognised {many:4}")
    if taken:
        lines.append(f"  {weights_told(taken)}")
    return "\n".join(lines)


def weights_told(taken: list[Row]) -> str:
    """How often weights are right, of masks that were taken for a stored object."""
    weight = np.array([row["weight"] for row in taken], np.float64)
    right = np.array([row["taken"] == row["is"] for row in taken])
    counts, rights = (np.histogram(those, WEIGHTS)[0] for those in (weight, weight[right]))
    bins = [
        f"{low:g} to {high:g}: {true} of {count}"
        for (low, high), true, count in zip(pairwise(WEIGHTS), rights, counts, strict=True)
        if count
    ]
    error = expected_calibration_error(weight, right)
    return f"weights  ECE {error:.3f}; right, {', '.join(bins)}"


@one_message()
def main() -> None:
    """Score every set that is named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--prior", type=Path, required=True)
    parser.add_argument("--data-root", type=Path, required=True)
    parser.add_argument("--truth", action="store_true", help="True masks in place of made ones.")
    parser.add_argument(
        "--least", type=int, default=1000, help="Pixels of depth that an object has."
    )
    parser.add_argument("-o", "--output", type=Path, help="All rows, as lines of JSON.")
    arguments = parser.parse_args()
    prior = open_prior(arguments.prior)
    again = Reconstructor(prior, retriever="appearance", workers=1)
    every: list[Row] = []
    for folder in arguments.scenes:
        rows: list[Row] = []
        for scene in find_scenes(folder):
            try:
                rows += rows_of(
                    scene, again, prior, arguments.data_root, arguments.truth, arguments.least
                )
            except BrrpError as error:
                print(f"{scene.name}: {error}", file=sys.stderr)
        print(report(folder.name, rows), flush=True)
        every += [{"set": folder.name, **row} for row in rows]
    if len(arguments.scenes) > 1:
        print(report("all", every))
    if arguments.output is not None:
        arguments.output.write_text("".join(json.dumps(row) + "\n" for row in every))


if __name__ == "__main__":
    main()
