"""How well does a session follow objects through a stream without masks?

    python tools/measure_stream.py SCENES... --prior PRIOR [--times 2] [--no-poses]

Each made scene (published layout, `tools/make_scenes.py --views 4`) is one stream: all its views,
each `--times` times, with white noise of 1 mm at 1 m that grows with the square of depth from the
second time on. Masks are made from depth. With `--no-poses` no frame tells where its camera was,
and only the session that tracks is measured. Printed for first views, for views that are seen
again and for other views, each with a session that tracks and with one that does not: CPU seconds
a frame; true objects whose mask is found (IoU over 0.7); of those that were found before, how many
have their id, and how many have another object's; how many are recognised as what they are, and as
what they are not. With `--data-root` also how far meshes and exact meshes are apart on average,
both ways, and of how many recognised objects the pose is right, or one of those that are told
beside it: points of the mesh are off by less than a tenth of its diameter on average.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import click
import numpy as np

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from measure_tracking import apart
from one_message import one_message
from score_masks import overlaps

from brrp_cli import Reconstructor, open_prior
from brrp_cli.errors import FrameError
from brrp_cli.evaluation.pose_error import RIGHT, pose_error, true_pose
from brrp_cli.frames.frame import Frame
from brrp_cli.ground_truth.scenes import Scene, find_scenes
from brrp_cli.ground_truth.surface_metrics import MeshSurface
from brrp_cli.ground_truth.truth import true_mesh
from brrp_cli.prior.store import Prior
from brrp_cli.seeds import child_rng

KINDS = ("first view", "the same view again", "another view")
LEAST, FOUND = 300, 0.7  # pixels of a true object; IoU
NOISE = 0.001
POINTS = 2_000  # on each of two surfaces that are compared


def noisy(frame: Frame, rng: np.random.Generator) -> Frame:
    """The frame with white noise on its depth, along the rays."""
    z = np.nan_to_num(frame.points[..., 2:], nan=1.0)
    factor = 1 + NOISE * z * rng.normal(size=z.shape)
    return replace(frame, points=(frame.points * factor).astype(np.float32))


def fits(true: np.ndarray, found: np.ndarray) -> dict[int, int]:
    """Id of a true object -> id of the mask that is found of it; of (H, W) ids, 0 = background."""
    iou, _ = overlaps(true.ravel(), found.ravel())
    ids, masks = (np.unique(each[each != 0]) for each in (true, found))
    sizes = [(true == i).sum() for i in ids]
    return {
        int(i): int(masks[row.argmax()])
        for i, row, size in zip(ids, iou, sizes, strict=True)
        if len(masks) and size >= LEAST and row.max() > FOUND
    }


def follow(
    session: Any,
    scene: Scene,
    times: int,
    seed: int,
    *,
    poses: bool = True,
    data_root: Path | None = None,
    prior: Prior | None = None,
) -> dict[str, Counter[str]]:
    """What became of one scene's objects, by kind of frame.

    poses : whether frames tell them; data_root : of the true meshes; None = they are not measured,
    nor are poses of objects of the prior
    """
    mesh_of = cache(lambda i: true_mesh(scene.object(i), data_root))
    true_surface = cache(lambda i: MeshSurface(mesh_of(i)))
    told: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    ids: dict[int, int] = {}
    for view in range(len(scene.views)):
        shown = scene.view(view)
        bare = shown.without_masks()
        if not poses:
            bare = replace(bare, T_world_cam=None)
        for again in range(times):
            row = told[KINDS[1] if again else KINDS[2] if view else KINDS[0]]
            frame = noisy(bare, child_rng(seed, scene.name, view, again)) if again else bare
            spent = time.process_time()
            row["frames"] += 1
            row["true"] += sum((shown.segmap == i).sum() >= LEAST for i in shown.object_ids)
            try:
                result = session(frame)
            except FrameError as error:
                click.echo(f"{scene.name}, view {view}: {error.what}", err=True)
                continue
            row["cpu"] += time.process_time() - spent
            outcome = {item.object_id: item for item in result.objects}
            for true, mask in fits(shown.segmap, result.frame.segmap).items():
                row["found"] += 1
                if true in ids:
                    row["before"] += 1
                    row["kept"] += ids[true] == mask
                row["swapped"] += any(i == mask and other != true for other, i in ids.items())
                ids[true] = mask
                recognised = outcome[mask].recognised
                name = None if recognised is None else recognised.name
                row["right"] += name == scene.object(true).name
                row["wrong"] += name not in (None, scene.object(true).name)
                if data_root is not None and outcome[mask].surface is not None:
                    mesh = outcome[mask].surface.as_trimesh().apply_transform(shown.T_world_cam)
                    rng = child_rng(seed, "surface", scene.name, view, true)
                    row["mm"] += 1000 * apart(MeshSurface(mesh), true_surface(true), POINTS, rng)
                    row["measured"] += 1
                if data_root is not None and name == scene.object(true).name and prior is not None:
                    there = true_pose(scene.object(true), mesh_of(true).vertices, shown.T_world_cam)
                    pose = pose_error(outcome[mask].recognised, prior.load(name), there)
                    row["posed"] += bool(pose)
                    for key in ("pose_error", "least_pose_error") if pose else ():
                        row[key] += pose[key] < RIGHT * pose["diameter"]
    return told


@click.command()
@click.argument("scenes", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--prior", required=True, type=click.Path(path_type=Path))
@click.option("--times", type=click.IntRange(1), default=2, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True)
@click.option("--poses/--no-poses", default=True, show_default=True, help="Of the cameras.")
@click.option("--data-root", type=click.Path(path_type=Path), help="Of the true meshes.")
@one_message()
def main(
    scenes: tuple[Path, ...],
    prior: Path,
    times: int,
    seed: int,
    workers: int,
    poses: bool,
    data_root: Path | None,
) -> None:
    """Print a table of streams."""
    opened = open_prior(prior)
    total = {(kind, track): Counter[str]() for track in (True, False) for kind in KINDS}
    for scene in (each for folder in scenes for each in find_scenes(folder)):
        # Who remembers nothing has no use for poses.
        for track in (True, False) if poses else (True,):
            with Reconstructor(opened, track=track, workers=workers, helpers=0) as session:
                told = follow(
                    session, scene, times, seed, poses=poses, data_root=data_root, prior=opened
                )
                for kind, row in told.items():
                    total[kind, track] += row
        click.echo(scene.folder, err=True)
    columns = ["CPU s", "masks found", "ids kept", "ids of others", "recognised", "wrongly"]
    columns += [] if data_root is None else ["mm", "poses right", "or told"]
    print("| frames | tracks | " + " | ".join(columns) + " |")
    print("| --- " * (len(columns) + 2) + "|")
    for (kind, track), row in total.items():
        if not row["frames"]:
            continue
        cells = [f"{row['cpu'] / row['frames']:.1f}", f"{row['found']} of {row['true']}"]
        cells += [f"{row['kept']} of {row['before']}", str(row["swapped"])] if track else ["-", "-"]
        cells += [str(row["right"]), str(row["wrong"])]
        if data_root is not None:
            cells.append(f"{row['mm'] / max(row['measured'], 1):.2f}")
            cells.append(f"{row['pose_error']} of {row['posed']}")
            cells.append(str(row["least_pose_error"]))
        print(f"| {kind} | {'yes' if track else 'no'} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
