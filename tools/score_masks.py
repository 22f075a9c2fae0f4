"""How good are masks without a model? IoU of `segment` against the true masks of made scenes.

    python tools/score_masks.py SCENES... [--pictures FOLDER] [--all]

For each set of scenes (published layout, as tools/make_scenes.py writes it) one line: of all true
objects with at least 150 pixels of valid depth, the mean IoU of the mask that fits each best (no
mask is used twice), how many are found (IoU over 0.5) and well found (over 0.75); of all masks, how
many fit no object (extra) and how many hold a good part of two objects (merged). Pixels without
depth are left out, and so are objects that the image's border cuts, unless --all asks for them.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from one_message import one_message
from PIL import Image
from scipy.optimize import linear_sum_assignment

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import BrrpError
from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.segmentation.left_out import border_share
from brrp_cli.segmentation.mask_picture import draw_masks
from brrp_cli.segmentation.segment import segment

MIN_PIXELS = 150


def overlaps(true: np.ndarray, found: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """IoU (T, F), and the part of each true object that each mask holds (T, F).

    true, found : (n,) ids of the same pixels, 0 = background. Rows and columns by ascending id.
    """
    true_ids, rows = np.unique(true, return_inverse=True)
    found_ids, columns = np.unique(found, return_inverse=True)
    shared = np.zeros((len(true_ids), len(found_ids)))
    np.add.at(shared, (rows, columns), 1)
    true_size, found_size = shared.sum(axis=1, keepdims=True), shared.sum(axis=0, keepdims=True)
    iou, part = shared / (true_size + found_size - shared), shared / true_size
    return (
        iou[np.ix_(true_ids != 0, found_ids != 0)],
        part[np.ix_(true_ids != 0, found_ids != 0)],
    )


def score(
    true: np.ndarray, found: np.ndarray, valid: np.ndarray, keep_all: bool = False
) -> dict[str, list[float]]:
    """IoU of each true object, and for each mask whether it is `extra` or `merged`."""
    sizes = np.bincount(np.maximum(true[valid], 0))
    small = np.flatnonzero((sizes > 0) & (sizes < MIN_PIXELS))
    not_asked = [i for i in small if i > 0]
    if not keep_all:
        limit = SegmentConfig().left_out.cut
        not_asked += [i for i in np.flatnonzero(sizes) if i and border_share(true == i) > limit]
    asked = valid & ~np.isin(true, not_asked)
    iou, part = overlaps(true[asked], found[asked])
    rows, columns = linear_sum_assignment(-iou)
    best = np.zeros(len(iou))
    best[rows] = iou[rows, columns]
    return {
        "iou": best.tolist(),
        "extra": (iou.max(axis=0, initial=0) < 0.25).astype(float).tolist(),
        "merged": ((part > 0.4).sum(axis=0) > 1).astype(float).tolist(),
    }


@one_message()
def main() -> None:
    """Score every set that is named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--pictures", type=Path, help="Draw the masks of every scene there.")
    parser.add_argument("--all", action="store_true", help="Also what the image's border cuts.")
    parser.add_argument("--views", type=int, default=1)
    arguments = parser.parse_args()
    for folder in arguments.scenes:
        total: dict[str, list[float]] = {"iou": [], "extra": [], "merged": []}
        start, frames = time.perf_counter(), 0
        for scene in find_scenes(folder):
            for view in range(min(arguments.views, len(scene.views))):
                try:
                    frame = scene.view(view)
                except BrrpError as error:  # no depth at all, as too near to the camera
                    print(f"{scene.name}: {error}", file=sys.stderr)
                    continue
                try:
                    found = segment(frame, keep_all=arguments.all)
                except BrrpError as error:
                    print(f"{scene.name}: {error}", file=sys.stderr)
                    found = np.zeros(frame.shape, np.int64)
                one = score(frame.segmap, found, frame.valid, arguments.all)
                for name, values in one.items():
                    total[name] += values
                frames += 1
                if arguments.pictures:
                    arguments.pictures.mkdir(parents=True, exist_ok=True)
                    name = f"{folder.name}_{scene.name}_{view}_{np.mean(one['iou']):.2f}.png"
                    Image.fromarray(draw_masks(frame.rgb, found)).save(arguments.pictures / name)
        iou = np.array(total["iou"])
        print(
            f"{folder.name}: {frames} frames, {len(iou)} objects, IoU {iou.mean():.3f}, "
            f"found {np.mean(iou > 0.5):.3f}, well {np.mean(iou > 0.75):.3f}; "
            f"{len(total['extra'])} masks, extra {np.mean(total['extra']):.3f}, "
            f"merged {np.mean(total['merged']):.3f}; "
            f"{(time.perf_counter() - start) / frames:.2f} s a frame"
        )


if __name__ == "__main__":
    main()
