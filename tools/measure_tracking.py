"""Measure a session that tracks, on a sequence of household shapes with known truth.

    python tools/measure_tracking.py --seed 2 --objects 5 --frames 7
    python tools/measure_tracking.py --seed 2 --objects 5 --frames 7 --no-track

The camera stands; in the third frame one object stands elsewhere; from the fifth on the camera
goes round the table, its pose known. Each frame has noise of a structured-light camera of its own
and masks that are numbered from left to right. Printed for each frame: seconds, how many objects
were inferred, how many ids went to another object, and the mean Chamfer distance of the meshes.
Uses the starter prior.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from brrp_cli.demo.layout import camera_pose, stand_apart
from brrp_cli.demo.scene import INTRINSICS, LIGHT_WORLD, SHAPE, TARGET, shade
from brrp_cli.demo.score import score
from brrp_cli.depth_noise.structured_light import add_depth_noise
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.raycast import look
from brrp_cli.seeds import child_rng
from brrp_cli.shapes import solids
from brrp_cli.shapes.household import household_shapes

MOVED_IN, ROUND_FROM = 2, 4  # frames, from 0
STEP = np.deg2rad(6)
TABLE = (150, 120, 90)


@dataclass(frozen=True)
class Shown:
    """A frame; truth : mask id -> (number of the object, its mesh in the camera frame)."""

    frame: Frame
    truth: dict[int, tuple[int, object]]


def sequence(seed: int, frames: int, objects: int) -> Iterator[Shown]:
    """The frames, one after the other; the same seed gives the same."""
    rng = child_rng(seed, "tracking")
    stored = household_shapes()
    shapes = [stored[i] for i in rng.choice(len(stored), objects, replace=False)]
    poses = None
    while poses is None:
        poses = stand_apart([shape.mesh for shape in shapes], rng)
    yaw = rng.uniform(0, 2 * np.pi)
    for number in range(frames):
        if number == MOVED_IN:
            # 8 cm away from all others.
            out = poses[0][:2, 3] - np.mean([pose[:2, 3] for pose in poses[1:]], axis=0)
            poses[0] = poses[0].copy()
            poses[0][:2, 3] += 0.08 * out / np.linalg.norm(out)
        turn = STEP * max(0, number - ROUND_FROM + 1)
        T_world_cam = camera_pose(TARGET, distance=0.85, pitch=np.deg2rad(40), yaw=yaw + turn)
        T_cam_world = np.linalg.inv(T_world_cam)
        meshes = [
            shape.mesh.copy().apply_transform(T_cam_world @ pose)
            for shape, pose in zip(shapes, poses, strict=True)
        ]
        slab = solids.moved(solids.box(1.4, 1.2, 0.03), z=-0.03).apply_transform(T_cam_world)
        sight = look([*meshes, slab], INTRINSICS, SHAPE)
        left = {i: np.nonzero(sight.index == i)[1].mean() for i in range(objects)}
        order = sorted(left, key=lambda i: left[i])
        ids = np.zeros(SHAPE, np.int64)
        for place, i in enumerate(order, start=1):
            ids[sight.index == i] = place
        colours = [*(shape.color for shape in shapes), TABLE]
        frame = make_frame(
            rgb=shade(sight, colours, T_cam_world[:3, :3] @ LIGHT_WORLD),
            segmap=ids,
            depth=add_depth_noise(sight.depth, INTRINSICS, child_rng(seed, "noise", number)),
            K=INTRINSICS,
            T_world_cam=T_world_cam,
        )
        yield Shown(frame, {place: (i, meshes[i]) for place, i in enumerate(order, start=1)})


def true_objects(shown: Shown, segmap: np.ndarray) -> dict[int, int]:
    """Id in another segmap of the same image -> number of the object."""
    return {
        int(np.median(segmap[shown.frame.segmap == place])): number
        for place, (number, _) in shown.truth.items()
    }


@click.command()
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the scene.")
@click.option("--frames", type=click.IntRange(1), default=6, show_default=True, help="In all.")
@click.option("--objects", type=click.IntRange(2, 8), default=3, show_default=True, help="Of them.")
@click.option("--workers", type=click.IntRange(1), help="Objects at a time. [default: cores]")
@click.option("--track/--no-track", default=True, help="Without, every frame stands alone.")
def main(seed: int, frames: int, objects: int, workers: int | None, track: bool) -> None:
    """Print a table of a tracked sequence."""
    from brrp_cli import Reconstructor
    from brrp_cli.prior.build.starter import starter_prior

    session = Reconstructor(starter_prior(), track=track, workers=workers)
    number_of: dict[int, int] = {}
    print("frame  wall s  cpu s  inferred  switches  Chamfer mm")
    for index, shown in enumerate(sequence(seed, frames, objects)):
        start, spent = time.perf_counter(), time.process_time()
        result = session(shown.frame)
        seconds, cpu = time.perf_counter() - start, time.process_time() - spent
        now = true_objects(shown, result.frame.segmap)
        switches = sum(number_of.setdefault(i, number) != number for i, number in now.items())
        switches += len(now) - len(set(now.values()))
        meshes = dict(shown.truth.values())
        distances = [
            score(o.surface.as_trimesh(), meshes[now[o.object_id]], seed).chamfer
            for o in result.reconstructed
        ]
        inferred = sum(bool(o.seconds) for o in result.objects)
        print(
            f"{index:>5}  {seconds:>6.1f}  {cpu:>5.1f}  {inferred:>8}  {switches:>8}"
            f"  {np.mean(distances) * 1000:>10.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
