"""Measure a session that tracks, with and without earlier views, on sequences with known truth.

    python tools/measure_tracking.py --seed 2 --sequences 4 --objects 6
    python tools/measure_tracking.py --seed 2 --frames 7 --moved-in 2 --round-from 4 --every

Half of the objects are household shapes of the starter prior, the others are drawn at random and
it lacks them. The camera stands at first and then goes round the table, its pose known, off by
`--pose-error`, or not told; in one frame one object stands 8 cm elsewhere. Each frame has noise of
a structured-light camera of its own and masks that are numbered from left to right. Printed after
so many frames, each with and without sharpening: CPU seconds of the last frame, how many objects
were inferred, how many ids have gone to another object so far, objects that were taken for what
they are, the mean distance between the meshes' surfaces and the exact ones, both ways, and the
mean uncertainty that was printed for them; of objects that the prior holds and of others apart.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from drawn.composed import draw_composed_shape
from drawn.household import draw_household_shape
from one_message import one_message

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.demo.layout import camera_pose, stand_apart
from brrp_cli.demo.scene import INTRINSICS, LIGHT_WORLD, SHAPE, TARGET, shade
from brrp_cli.depth_noise.structured_light import add_depth_noise
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import similarity
from brrp_cli.ground_truth.surface_metrics import MeshSurface
from brrp_cli.raycast import look
from brrp_cli.seeds import child_rng
from brrp_cli.shapes import solids
from brrp_cli.shapes.household import Shape, household_shapes

MOVED_IN, ROUND_FROM = 5, 1  # frames, from 0
STEP = np.deg2rad(10)
TABLE = (150, 120, 90)
AFTER = (1, 2, 5, 10)  # frames
POINTS = 4_000  # on each of two surfaces that are compared


@dataclass(frozen=True)
class Shown:
    """A frame; truth : mask id -> (number of the object, its mesh in the camera frame)."""

    frame: Frame
    truth: dict[int, tuple[int, object]]


@dataclass(frozen=True)
class Course:
    """step : radians by which the camera goes on from frame `round_from` on; in frame `moved_in`
    one object stands elsewhere; pose_error : metres, standard deviation of what each frame's pose
    is off at the table, by its place and as much again by its direction; None = no frame tells it
    """

    moved_in: int = MOVED_IN
    round_from: int = ROUND_FROM
    step: float = float(STEP)
    pose_error: float | None = 0.0


def shapes_of(seed: int, objects: int) -> list[Shape]:
    """Half of them of the starter prior, by name; the others drawn, with an empty name."""
    rng = child_rng(seed, "tracking")
    stored = household_shapes()
    known = [stored[i] for i in rng.choice(len(stored), (objects + 1) // 2, replace=False)]
    drawn = []
    for number in range(objects - len(known)):
        own = child_rng(seed, "tracking", "drawn", number)
        mesh = draw_composed_shape(own) if number % 2 else draw_household_shape(own)[1]
        middle = mesh.bounds.mean(axis=0)
        mesh.apply_translation([-middle[0], -middle[1], -mesh.bounds[0, 2]])
        drawn.append(Shape("", "", mesh, tuple(int(c) for c in own.integers(40, 220, 3))))
    return known + drawn


def sequence(seed: int, frames: int, objects: int, course: Course | None = None) -> Iterator[Shown]:
    """The frames, one after the other; the same seed gives the same."""
    course = course or Course()
    rng = child_rng(seed, "tracking", "places")
    shapes = shapes_of(seed, objects)
    poses = None
    while poses is None:
        poses = stand_apart([shape.mesh for shape in shapes], rng)
    yaw = rng.uniform(0, 2 * np.pi)
    for number in range(frames):
        if number == course.moved_in:
            # 8 cm away from all others.
            out = poses[0][:2, 3] - np.mean([pose[:2, 3] for pose in poses[1:]], axis=0)
            poses[0] = poses[0].copy()
            poses[0][:2, 3] += 0.08 * out / np.linalg.norm(out)
        turn = course.step * max(0, number - course.round_from + 1)
        T_world_cam = camera_pose(TARGET, distance=0.85, pitch=np.deg2rad(40), yaw=yaw + turn)
        T_cam_world = np.linalg.inv(T_world_cam)
        meshes = [
            shape.mesh.copy().apply_transform(T_cam_world @ pose)
            for shape, pose in zip(shapes, poses, strict=True)
        ]
        slab = solids.moved(solids.box(1.4, 1.2, 0.03), z=-0.03).apply_transform(T_cam_world)
        sight = look([*meshes, slab], INTRINSICS, SHAPE)
        left = {
            i: np.nonzero(sight.index == i)[1].mean()
            for i in range(objects)
            if (sight.index == i).any()
        }
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
            T_world_cam=_told(T_world_cam, course.pose_error, child_rng(seed, "pose", number)),
        )
        yield Shown(frame, {place: (i, meshes[i]) for place, i in enumerate(order, start=1)})


def _told(
    T_world_cam: np.ndarray, error: float | None, rng: np.random.Generator
) -> np.ndarray | None:
    """A pose that is off by `error` metres at the table; None = nothing is told."""
    if error is None:
        return None
    from scipy.spatial.transform import Rotation

    turn, shift = rng.normal(size=(2, 3)) * error / np.sqrt(3)
    wrong = similarity(rotation=Rotation.from_rotvec(turn / 0.85).as_matrix(), translation=shift)
    return np.asarray(T_world_cam @ wrong)


def true_objects(shown: Shown, segmap: np.ndarray) -> dict[int, int]:
    """Id in another segmap of the same image -> number of the object."""
    return {
        int(np.median(segmap[shown.frame.segmap == place])): number
        for place, (number, _) in shown.truth.items()
    }


def surface_distance(mesh: object, truth: object, seed: int) -> float:
    """Metres, the mean distance of points of either mesh to the other's triangles."""
    rng = child_rng(seed, "surface")
    return apart(MeshSurface(mesh), MeshSurface(truth), POINTS, rng)


def apart(one: MeshSurface, other: MeshSurface, points: int, rng: np.random.Generator) -> float:
    """Metres, the mean distance of `points` points of either mesh to the other's triangles."""
    ways = [b.nearest(a.sample(points, rng)[0]).distance for a, b in ((one, other), (other, one))]
    return float(np.mean(ways))


Rows = dict[tuple[bool, int], dict[str, list[float]]]


def measure(session: object, shown: list[Shown], shapes: list[Shape], seed: int) -> list[dict]:
    """One dictionary of lists for each frame."""
    number_of: dict[int, int] = {}
    switches, rows = 0, []
    for each in shown:
        start, spent = time.perf_counter(), time.process_time()
        result = session(each.frame)
        row: dict[str, list[float]] = defaultdict(list)
        row["wall"].append(time.perf_counter() - start)
        row["cpu"].append(time.process_time() - spent)
        now = true_objects(each, result.frame.segmap)
        switches += sum(number_of.setdefault(i, number) != number for i, number in now.items())
        switches += len(now) - len(set(now.values()))
        row["switches"].append(switches)
        row["inferred"].append(sum(bool(o.seconds) for o in result.objects))
        meshes = dict(each.truth.values())
        for item in result.reconstructed:
            number = now[item.object_id]
            kind = "known" if shapes[number].name else "other"
            mesh = item.surface.as_trimesh()
            row[f"{kind} mm"].append(1000 * surface_distance(mesh, meshes[number], seed))
            row[f"{kind} ±"].append(1000 * (item.mean_uncertainty or np.nan))
            found = item.recognised.name if item.recognised else ""
            row[f"{kind} right"].append(found == shapes[number].name)
        rows.append(row)
    return rows


@click.command()
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the first.")
@click.option("--sequences", type=click.IntRange(1), default=1, show_default=True, help="In all.")
@click.option("--frames", type=click.IntRange(1), default=10, show_default=True, help="Of each.")
@click.option("--objects", type=click.IntRange(2, 8), default=6, show_default=True, help="Of each.")
@click.option("--moved-in", type=click.IntRange(1), default=MOVED_IN, show_default=True)
@click.option("--round-from", type=click.IntRange(1), default=ROUND_FROM, show_default=True)
@click.option("--step", type=float, default=float(np.rad2deg(STEP)), show_default=True)
@click.option("--pose-error", type=float, default=0.0, show_default=True, help="Millimetres.")
@click.option("--no-poses", is_flag=True, help="Frames do not tell them.")
@click.option("--every", is_flag=True, help="Print every frame.")
@click.option("--workers", type=click.IntRange(1), help="Objects at a time. [default: cores]")
@one_message()
def main(
    seed: int,
    sequences: int,
    frames: int,
    objects: int,
    moved_in: int,
    round_from: int,
    step: float,
    pose_error: float,
    no_poses: bool,
    every: bool,
    workers: int | None,
) -> None:
    """Print a table of tracked sequences."""
    from brrp_cli import Reconstructor, open_prior
    from brrp_cli.prior.build.starter import starter_prior

    course = Course(
        moved_in, round_from, float(np.deg2rad(step)), None if no_poses else pose_error / 1000
    )
    prior = open_prior(starter_prior())
    alone = replace(TrackConfig(), sharpen=None)
    total: Rows = defaultdict(lambda: defaultdict(list))
    for number in range(seed, seed + sequences):
        shown, shapes = list(sequence(number, frames, objects, course)), shapes_of(number, objects)
        for sharp in (False, True):
            track = TrackConfig() if sharp else alone
            session = Reconstructor(prior, track=track, workers=workers)
            if number == seed and not sharp:
                session(shown[0].frame)  # what is loaded once is loaded
                session = Reconstructor(prior, track=track, workers=workers)
            for frame, row in enumerate(measure(session, shown, shapes, number), start=1):
                for name, values in row.items():
                    total[sharp, frame][name] += values
        click.echo(f"{number}", err=True)
    columns = ["cpu", "inferred", "switches"]
    columns += [f"{k} {c}" for k in ("known", "other") for c in ("mm", "±", "right")]
    print("| frames | " + " | ".join(columns) + " |")
    print("| --- " * (len(columns) + 1) + "|")
    for frame in range(1, frames + 1) if every else [n for n in AFTER if n <= frames]:
        cells = []
        for name in columns:
            without, with_ = (np.array(total[sharp, frame][name]) for sharp in (False, True))
            if name.endswith("right"):
                cells.append(f"{int(without.sum())} → {int(with_.sum())} of {len(with_)}")
            elif name == "switches":
                cells.append(f"{int(without.sum())} → {int(with_.sum())}")
            else:
                cells.append(f"{without.mean():.2f} → {with_.mean():.2f}")
        print(f"| {frame} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
