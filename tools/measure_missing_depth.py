"""What becomes of stored objects of which a camera measures little?

    python tools/measure_missing_depth.py SCENES... --prior PRIOR [--data-root DATA] [--scenes N]
        [--left SHARE]

For each set of scenes, in the first view of each, with true masks: the objects that the prior
holds, by the share of their masks' pixels that have depth. --left takes depth away first, but for
patches that hold that share of each object.

right    taken for what they are; wrong : taken for another stored object
no mesh  fewer points than a shape needs, and no stored object that is more probable than not
mm, F    mean distance between the written mesh and the exact one, and F-score at 5 mm (0 without a
         mesh), and the median distance
printed  mm, root mean square of the uncertainty on the surface, and of what it is off
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.api import reconstruct
from brrp_cli.evaluation.bootstrap import mean_interval
from brrp_cli.frames.frame import Frame
from brrp_cli.ground_truth.scenes import Scene, find_scenes, true_mesh_in_camera
from brrp_cli.ground_truth.surface_metrics import MeshSurface
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.reconstruction import ObjectReconstruction
from brrp_cli.seeds import child_rng

# Upper ends of the bins of the share with depth.
SHARES = (0.05, 0.2, 0.6, 1.0)
# Pixels of a mask that is counted, and points of a surface that are compared.
LEAST, POINTS = 200, 4000
# Pixels, standard deviation of the noise that patches are cut from.
PATCH = 4


@dataclass(frozen=True)
class Row:
    """One object. scene; share : of its mask that has depth; right, wrong : what it was taken for;
    distance : metres, NaN without a mesh; f_score : at 5 mm; printed, off : metres, squared"""

    scene: str
    share: float
    right: bool
    wrong: bool
    distance: float
    f_score: float
    printed: float
    off: float


def with_patches(frame: Frame, left: float, name: str) -> Frame:
    """The frame with depth of its objects in patches alone, which hold the share `left` of the
    pixels of each that have any."""
    from scipy.ndimage import gaussian_filter

    noise = gaussian_filter(child_rng(0, "patches", name).normal(size=frame.shape), PATCH)
    lost = np.zeros(frame.shape, dtype=bool)
    for object_id in frame.object_ids:
        seen = frame.valid & (frame.segmap == object_id)
        if seen.any():
            lost |= seen & (noise < np.quantile(noise[seen], 1 - left))
    return frame.with_points(np.where(lost[..., None], np.float32(np.nan), frame.points))


def rows_of(scene: Scene, prior: Prior, data_root: Path | None, left: float) -> Iterator[Row]:
    """A row for each object of the scene's first view that the prior holds."""
    frame = scene.view(0)
    if left < 1:
        frame = with_patches(frame, left, scene.name)
    for item in reconstruct(frame, prior, device="cpu", workers=1).objects:
        mask = frame.segmap == item.object_id
        true = scene.object(item.object_id)
        if true.name not in prior.names or mask.sum() < LEAST:
            continue
        assert frame.T_world_cam is not None
        truth = MeshSurface(true_mesh_in_camera(true, data_root, frame.T_world_cam))
        taken = item.recognised
        yield Row(
            scene.name,
            float(frame.valid[mask].mean()),
            taken is not None and taken.name == true.name,
            taken is not None and taken.name != true.name,
            *_surface(item, truth, scene.name),
        )


def _surface(
    item: ObjectReconstruction, truth: MeshSurface, name: str
) -> tuple[float, float, float, float]:
    if item.surface is None:
        return np.nan, 0.0, np.nan, np.nan
    rng = child_rng(0, "missing depth", name, item.object_id)
    made = MeshSurface(item.surface.as_trimesh())
    to_truth = truth.nearest(made.sample(POINTS, rng)[0]).distance
    from_truth = made.nearest(truth.sample(POINTS, rng)[0]).distance
    near = [float((each < 0.005).mean()) for each in (to_truth, from_truth)]
    return (
        float(to_truth.mean() + from_truth.mean()) / 2,
        2 * near[0] * near[1] / max(sum(near), 1e-9),
        float(np.mean(item.surface.uncertainty.astype(np.float64) ** 2)),
        float(np.mean(to_truth**2)),
    )


def table(name: str, rows: list[Row]) -> list[str]:
    """Rows of Markdown, one for each bin that holds anything."""
    lines = []
    for low, high in pairwise((-1.0, *SHARES)):
        chosen = [row for row in rows if low < row.share <= high]
        if not chosen:
            continue
        distances = np.array([row.distance for row in chosen])
        made = np.isfinite(distances)
        f_score = mean_interval(
            [row.f_score for row in chosen],
            [row.scene for row in chosen],
            np.random.default_rng(0),
        )
        # Of one scene there is no interval.
        interval = f" [{f_score.low:.3f}, {f_score.high:.3f}]" if np.isfinite(f_score.low) else ""
        cells = [
            name,
            f"{100 * max(low, 0):g} to {100 * high:g} %",
            str(len(chosen)),
            _percent([row.right for row in chosen]),
            _percent([row.wrong for row in chosen]),
            _percent(~made),
            f"{1000 * np.nanmean(distances):.2f}, {1000 * np.nanmedian(distances):.2f}"
            if made.any()
            else "-",
            f"{f_score.value:.3f}{interval}",
            f"{_root_mean([row.printed for row in chosen])}, "
            f"{_root_mean([row.off for row in chosen])}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _percent(flags: list[bool] | NDArray[np.bool_]) -> str:
    return f"{100 * np.mean(flags):.0f} %"


def _root_mean(squares: list[float]) -> str:
    made = [each for each in squares if np.isfinite(each)]
    return f"{1000 * np.sqrt(np.mean(made)):.1f}" if made else "-"


@one_message()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", type=Path, nargs="+", help="folders of scenes")
    parser.add_argument("--prior", type=Path, required=True)
    parser.add_argument("--data-root", type=Path, help="of true meshes")
    parser.add_argument("--scenes", type=int, dest="count", help="of each folder, by default all")
    parser.add_argument("--left", type=float, default=1.0, help="share of depth that is left")
    arguments = parser.parse_args()
    prior = open_prior(arguments.prior)
    print("| set | depth | objects | right | wrong | no mesh | mm | F(5 mm) | printed, off |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for folder in arguments.scenes:
        rows: list[Row] = []
        for scene in find_scenes(folder)[: arguments.count]:
            rows += rows_of(scene, prior, arguments.data_root, arguments.left)
        print("\n".join(table(folder.name, rows)), flush=True)


if __name__ == "__main__":
    main()
