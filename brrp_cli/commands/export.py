"""`brrp export OUT/`: collision shapes for simulators and motion planners."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.commands.json_option import json_option, report_of
from brrp_cli.commands.results_folder import require_results
from brrp_cli.commands.seed_option import SEED, SEED_HELP
from brrp_cli.physics import DENSITY
from brrp_cli.planning.options import PlanOptions
from brrp_cli.planning.parts import COACD, HOW, check_available
from brrp_cli.progress import note
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.planning.scene import PlannedObject
    from brrp_cli.results.read import StoredResult

FOLDER = "plan"
# An object that moves by more in three seconds does not rest: mm, degrees.
SHIFTS, TURNS = 5.0, 5.0
CONFIDENCE = click.FloatRange(0.5, 0.999)


@click.command("export")
@click.argument("results", metavar="OUT/", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="Folder to write. [default: OUT/plan]"
)
@click.option(
    "--collision",
    type=click.Choice(HOW),
    default=COACD,
    show_default=True,
    help="coacd keeps hollows and takes seconds an object; hull is one part and fills them.",
)
@click.option(
    "--confidence",
    type=CONFIDENCE,
    help="Collision shapes inside which each object lies with this probability, such as 0.95. "
    "[default: shapes of the meshes]",
)
@click.option(
    "--margin",
    type=click.FloatRange(min=0, max=200),
    default=0.0,
    show_default=True,
    help="Millimetres by which the shapes of --confidence grow into space not seen to be empty.",
)
@click.option(
    "--density",
    type=click.FloatRange(min=0, min_open=True),
    default=DENSITY,
    show_default=True,
    help="kg / m^3 of solid objects, for mass and inertia.",
)
@click.option(
    "--moveit",
    is_flag=True,
    help="Also write a planning scene for MoveIt, with the grasps of `brrp grasp`.",
)
@click.option(
    "--frame-id",
    metavar="NAME",
    help="What MoveIt calls the frame of the results. [default: camera or world]",
)
@click.option(
    "--rest/--no-rest",
    default=None,
    help="Move objects, as little as it takes, to where they rest in a simulation. Not with "
    "--confidence. [default: rest, without --confidence]",
)
@click.option("--seed", type=SEED, default=0, show_default=True, help=SEED_HELP)
@json_option
@click.option("--overwrite", is_flag=True, help="Replace the output folder if it is there.")
def command(
    results: Path,
    output: Path | None,
    collision: str,
    confidence: float | None,
    margin: float,
    density: float,
    moveit: bool,
    frame_id: str | None,
    rest: bool | None,
    seed: int,
    as_json: bool,
    overwrite: bool,
) -> None:
    """Turn results into collision shapes: URDF, MJCF, a cuRobo world, a scene for MoveIt.

    OUT/ is a folder that `brrp reconstruct` wrote. For each object: convex parts, a URDF and an
    MJCF; for all of them scene.xml (MuJoCo), world.yml (cuRobo) and scene.glb, in the frame of
    the results. Lengths are metres, masses kilograms.

    \b
    Example:
      brrp export out/ --collision hull
      brrp export out/ --confidence 0.95 -o plan/
      brrp export out/ --confidence 0.95 --moveit --frame-id base_link
    """
    if margin and confidence is None:
        raise click.UsageError("--margin grows the shapes of --confidence, so give both")
    if rest and confidence is not None:
        raise click.UsageError(
            "--rest and --confidence exclude each other: shapes that hold objects with a"
            " probability hold them where they were measured"
        )
    if frame_id is not None and not moveit:
        raise click.UsageError("--frame-id is of the planning scene of --moveit, so give both")
    require_results(results)

    from brrp_cli.api import open_result

    scene = (frame_id or "") if moveit else None
    options = PlanOptions(
        collision, confidence, margin / 1000, density, seed, scene, rest is not False
    )
    check_libraries(options)
    with report_of(as_json) as report:
        record = export(open_result(results), output, options, overwrite=overwrite)
        report["output"] = str(output or results / FOLDER)
        report.update(record)


def check_libraries(options: PlanOptions) -> None:
    """DependencyError where one is missing that these options need."""
    from brrp_cli.planning.rest import check_simulator

    check_available(options.collision)
    if options.rests:
        check_simulator()


def export(
    stored: StoredResult, output: Path | None, options: PlanOptions, *, overwrite: bool
) -> dict[str, Any]:
    """Write the plan, with a line for each object; its record. Errors: those of `write_plan`."""
    from brrp_cli.planning.write import write_plan

    folder = output or stored.folder / FOLDER
    record = write_plan(
        stored, folder, options, overwrite=overwrite, planned=watched(stored, options)
    )
    for item in record["objects"]:
        note(f"  object {item['id']}: {told(item)}")
    for item in record["left_out"]:
        note(f"  object {item['id']}: left out, {item['why']}")
    shapes = (
        "of the meshes"
        if options.confidence is None
        else f"that hold the objects with probability {options.confidence:g}"
    )
    names = ("moveit.scene", "moveit.json", "moveit_grasps.json")
    moveit = "".join(f"{name}, " for name in names if (folder / name).is_file())
    click.echo(
        f"Wrote collision shapes {shapes} ({options.collision}) of"
        f" {counted(len(record['objects']), 'object')}, metres, {record['frame']} frame: {folder}/ "
        f"(object_*.urdf, object_*.xml, scene.xml, world.yml, {moveit}scene.glb, plan.json)"
    )
    return record


def told(item: dict[str, Any]) -> str:
    """One object's numbers for people."""
    count, rest = len(item["parts"]), item["rest"]
    text = f"{counted(count, 'part')}, {item['mass'] * 1000:.0f} g"
    if rest is not None:
        text += f", put to rest {rest['moved_mm']:.1f} mm and {rest['turned_degrees']:.1f}° away"
        if rest["foot_mm"]:
            text += f", on a foot of {rest['foot_mm']:.0f} mm" + " and a plate" * rest["plate"]
        left = rest["left_alone"]
        if left["moved_mm"] > SHIFTS or left["turned_degrees"] > TURNS:
            text += (
                f"; left alone it moves by {left['moved_mm']:.0f} mm"
                f" and {left['turned_degrees']:.0f}°"
            )
    if "level" in item:
        text += (
            f", {item['margin_mean'] * 1000:.1f} mm beyond the mesh on average"
            f" ({item['margin_max'] * 1000:.0f} at most)"
        )
        if not item["bounded"]:
            text += "; the shape is cut off where the posterior ends"
    return text


def watched(stored: StoredResult, options: PlanOptions) -> Iterator[PlannedObject]:
    """The planned objects behind a progress bar."""
    from brrp_cli.planning.scene import planned_objects
    from brrp_cli.progress import progress

    return iter(progress(planned_objects(stored, options), "collision", len(stored.surfaces)))
