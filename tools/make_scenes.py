"""Make procedural tabletop scenes with ground truth, in the layout that `brrp eval` reads.

PyBullet drops 3 to 10 objects on a table, lets them settle and draws colour, depth buffer and ids
from random views. A scene depends on the meshes, the seed and its number alone. Needs
`pip install .[sim]`.

The three sets of docs/accuracy.md, and the same scenes as a structured-light camera sees them
(`ycb` is the folder with YCB's archives unpacked, NNN_name/google_16k/textured.obj):

    UNSEEN=030,031,032,065-b,065-d,072-a,073-e
    python tools/make_scenes.py --meshes ycb --skip $UNSEEN --scenes 20 -o scenes/prior
    python tools/make_scenes.py --meshes ycb --only $UNSEEN --scenes 20 -o scenes/unseen
    python tools/export_random_shapes.py -o random_shapes
    python tools/make_scenes.py --meshes random_shapes --scenes 20 -o scenes/other

and each with `--noise structured-light -o scenes/..._noise`. Sets to tune on: `--seed 1000`.
`--sensor stereo`, `xtion` or `kinect-azure` shows them as such a camera would, with its waves,
bleeding silhouettes, steps and holes (docs/sensors.md); it takes the place of `--noise`.
`--light varied` draws colour and brightness of the light, gamma and pixel noise for each scene;
what stands where stays as it is.
`--stack` drops every second object onto the one before it, which stands with its open side up
where it has one: can on can, jar in bowl. It draws other scenes than a set without it.
`--platform` lets them lie on a board of any size, 3 to 30 mm thick, which is background, as the
table is, and `--bin` in a bin. Both draw other scenes than a set without them.
`--wall` puts a wall behind the objects, which is background, too. Depth and colours differ from a
set without it.
`--robot` lets the arm of a robot reach in over the objects. It is background, though no table.
Depth and colours differ from a set without it.
`--shelf` lets them stand in a compartment of a shelf, which is background, with cameras before it:
`--elevation 5 30` sees in. It draws other scenes than a set without it.
`--dark-table` makes the table, or what a shelf stands on, black and shiny. Depth and colours differ
from a set without it.
`--distance`, `--elevation` and `--roll` say where cameras stand: `--elevation 70 89` looks down,
`--distance 0.3 0.5` is a camera at a wrist, which `--roll -180 180` turns about its line of sight.

Objects collide as convex hulls (tools/tabletop/settle.py says what that means). A pixel without a
return has depth buffer 1.0, the far plane.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import click
import numpy as np
from tqdm import tqdm

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message
from tabletop.camera import Standpoint
from tabletop.check import MIN_PIXELS, Distance
from tabletop.held_out import LEAVE, MIXED, TAKE, chosen
from tabletop.models import find_meshes
from tabletop.names_option import prefixes
from tabletop.scene import LIGHTS, LIMITS, SENSOR_NAMES, Plan, check_depth, make_scene

from brrp_cli.dependencies import import_library
from brrp_cli.errors import SceneError

CHECK_EVERY = 5


def _size(_context: click.Context, _option: click.Parameter, value: str) -> tuple[int, int]:
    width, _, height = value.partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) > 0 and int(height) > 0):
        raise click.BadParameter("expected WIDTHxHEIGHT, as in 640x480")
    return int(width), int(height)


@click.command()
@click.option("--meshes", type=click.Path(path_type=Path), help="Folder of meshes, metres.")
@click.option("--only", default="", callback=prefixes, help="Names to take, as in 030,065-b.")
@click.option("--skip", default="", callback=prefixes, help="Names to leave out.")
@click.option(
    "--held-out",
    default=MIXED,
    show_default=True,
    type=click.Choice([MIXED, LEAVE, TAKE]),
    help="What to do with the names of data_manifests/household_held_out.toml.",
)
@click.option(
    "--data-root",
    type=click.Path(path_type=Path),
    help="Mesh paths are relative to it [MESHES/..].",
)
@click.option("--scenes", default=20, show_default=True, type=click.IntRange(1))
@click.option("--views", default=2, show_default=True, type=click.IntRange(1))
@click.option("--seed", default=0, show_default=True)
@click.option("--noise", default="none", show_default=True, type=click.Choice(list(LIMITS)))
@click.option("--sensor", default="none", show_default=True, type=click.Choice(SENSOR_NAMES))
@click.option("--light", default="plain", show_default=True, type=click.Choice(list(LIGHTS)))
@click.option("--stack", "stacked", is_flag=True, help="Set objects on and into one another.")
@click.option("--platform", "on_platform", is_flag=True, help="Drop objects onto a platform.")
@click.option("--bin", "binned", is_flag=True, help="Drop objects into a bin.")
@click.option("--wall", "walled", is_flag=True, help="Put a wall behind them.")
@click.option("--shelf", "shelved", is_flag=True, help="Stand objects in a shelf.")
@click.option("--robot", is_flag=True, help="Let an arm reach in over them.")
@click.option("--dark-table", is_flag=True, help="A black and shiny one.")
@click.option("--size", default="640x480", show_default=True, callback=_size)
@click.option(
    "--distance",
    default=Standpoint.distance,
    show_default=True,
    nargs=2,
    type=float,
    help="Of cameras from the objects' middle, metres.",
)
@click.option(
    "--elevation",
    default=Standpoint.elevation,
    show_default=True,
    nargs=2,
    type=float,
    help="Of cameras above the table, degrees.",
)
@click.option(
    "--roll",
    default=Standpoint.roll,
    show_default=True,
    nargs=2,
    type=float,
    help="Of cameras about their line of sight, degrees.",
)
@click.option(
    "--orbit",
    default=0.0,
    show_default=True,
    type=click.FloatRange(-180, 180),
    help="Degrees that the camera goes round from view to view; 0: it stands anywhere.",
)
@click.option("--workers", default=1, show_default=True, type=click.IntRange(1))
@click.option("--overwrite", is_flag=True, help="Replace scenes that are there.")
@click.option("--check", is_flag=True, help="Only check every scene of OUTPUT; write nothing.")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@one_message()
def main(
    meshes: Path | None,
    only: tuple[str, ...],
    skip: tuple[str, ...],
    held_out: str,
    data_root: Path | None,
    scenes: int,
    views: int,
    seed: int,
    noise: str,
    sensor: str,
    light: str,
    stacked: bool,
    on_platform: bool,
    binned: bool,
    walled: bool,
    shelved: bool,
    robot: bool,
    dark_table: bool,
    size: tuple[int, int],
    distance: tuple[float, float],
    elevation: tuple[float, float],
    roll: tuple[float, float],
    orbit: float,
    workers: int,
    overwrite: bool,
    check: bool,
    output: Path,
) -> None:
    """Make tabletop scenes of MESHES in OUTPUT, and check a fifth of them."""
    if noise != "none" and sensor != "none":
        raise click.UsageError("--noise and --sensor exclude each other: a sensor brings its own")
    if sum((stacked, on_platform, binned, shelved)) > 1:
        raise click.UsageError("--stack, --platform, --bin and --shelf exclude one another")
    held = on_platform or binned or shelved
    if (walled or robot) and (held or (walled and robot) or views > 1):
        raise click.UsageError(
            "--wall and --robot take --views 1, which decides where they stand; no --platform,"
            " --bin or --shelf, and not both"
        )
    if data_root is None:
        if meshes is None:
            raise click.UsageError("name the meshes: --meshes, or --data-root with --check")
        data_root = meshes.absolute().parent
    data_root = data_root.absolute()
    if check:
        _report(_check_all(output, data_root, noise, sensor), output)
        return
    if meshes is None:
        raise click.UsageError("--meshes is needed to make scenes")
    import_library("pybullet")
    if sensor == "stereo":
        import_library("cv2")
    paths = chosen(find_meshes(meshes, only, skip), held_out)
    found = tuple(path.absolute() for path in paths)
    if not found[0].is_relative_to(data_root):
        raise click.UsageError(f"{meshes} does not lie below --data-root {data_root}")
    plan = Plan(
        found,
        data_root,
        output,
        seed,
        views,
        noise,
        size,
        overwrite,
        light,
        sensor,
        stacked,
        on_platform,
        binned,
        walled,
        shelved,
        robot,
        dark_table,
        Standpoint(distance, elevation, roll),
        orbit,
    )
    _report(list(_make_all(plan, scenes, workers)), output)


def _make_all(plan: Plan, scenes: int, workers: int) -> Iterator[Distance]:
    numbers = range(scenes)
    checks = [number % CHECK_EVERY == 0 for number in numbers]
    make = partial(make_scene, plan)
    if workers == 1:
        done = map(make, numbers, checks)
        for distances in tqdm(done, total=scenes, desc="scenes"):
            yield from distances
        return
    # Fresh processes: PyBullet and Open3D do not survive a fork with their threads running.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for distances in tqdm(pool.map(make, numbers, checks), total=scenes, desc="scenes"):
            yield from distances


def _check_all(output: Path, data_root: Path, noise: str, sensor: str) -> list[Distance]:
    folders = sorted(path.parent for path in output.glob("*/objects.json"))
    if not folders:
        raise SceneError("No scene to check", where=output, expected="NNNNNNNN/objects.json")
    return [
        distance
        for folder in tqdm(folders, desc="check")
        for distance in check_depth(folder, data_root, noise, sensor)
    ]


def _report(distances: list[Distance], output: Path) -> None:
    if not distances:
        raise SceneError(
            "Nothing could be checked: no object fills enough pixels",
            where=output,
            expected=f"{MIN_PIXELS} pixels of an object",
        )
    medians = np.array([d.median for d in distances]) * 1000
    highs = np.array([d.percentile95 for d in distances]) * 1000
    click.echo(
        f"{output}: {len(distances)} objects in {len({d.view for d in distances})} views checked;"
        f" distance of pixels to the posed mesh, mm: median {np.median(medians):.3f}"
        f" (worst {medians.max():.3f}), 95 % {np.median(highs):.3f} (worst {highs.max():.3f})"
    )


if __name__ == "__main__":
    main()
