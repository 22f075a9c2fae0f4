"""`brrp grasp OUT/`: ranked grasps of every object."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.commands.json_option import json_option, report_of
from brrp_cli.commands.output_file import require_suffix
from brrp_cli.commands.seed_option import SEED, SEED_HELP
from brrp_cli.config.grasping import GraspConfig, SurroundingsConfig
from brrp_cli.grasping.gripper_file import DEFAULT, gripper_names, open_gripper
from brrp_cli.grasping.layouts import LAYOUTS
from brrp_cli.grasping.options import ALL, APPROACHES, MIN_SCORE, PER_OBJECT
from brrp_cli.grasping.record import RECORD
from brrp_cli.progress import note
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.grasping.grasp import GraspPlan, ObjectGrasps
    from brrp_cli.grasping.gripper import Gripper
    from brrp_cli.results.read import StoredResult

JSON = "json"
GRIPPER_HELP = f"{', '.join(gripper_names())}, or a YAML file."


@click.command("grasp")
@click.argument("results", metavar="OUT/", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="GRASPS.json",
    help=f"File to write. [default: OUT/{RECORD}]",
)
@click.option(
    "--gripper", metavar="NAME|FILE.yaml", default=DEFAULT, show_default=True, help=GRIPPER_HELP
)
@click.option(
    "--approach",
    type=click.Choice(APPROACHES),
    default=ALL,
    show_default=True,
    help=f"top-down: within {GraspConfig.top_down:g} degrees of straight down; "
    f"cone: within {GraspConfig.cone:g}.",
)
@click.option(
    "--per-object",
    type=click.IntRange(1, 1000),
    default=PER_OBJECT,
    show_default=True,
    help="Grasps of an object, at most.",
)
@click.option(
    "--min-score",
    type=click.FloatRange(0, 1),
    default=MIN_SCORE,
    show_default=True,
    help="Leave out grasps that hold with less probability.",
)
@click.option(
    "--friction",
    type=click.FloatRange(0.01, 5),
    default=GraspConfig.friction,
    show_default=True,
    help="Coulomb's coefficient between fingers and object.",
)
@click.option(
    "--confidence",
    type=click.FloatRange(0, 0.999),
    default=GraspConfig.confidence,
    show_default=True,
    help="The hand keeps out of shapes that hold the neighbours with this probability; 0: out of "
    "their meshes.",
)
@click.option(
    "--avoid-arms",
    is_flag=True,
    help="Keep out of arms that reach into the image through the air, too. Without it they are "
    "taken for the robot's own, which moves.",
)
@click.option(
    "--format",
    "layout",
    type=click.Choice([JSON, *LAYOUTS]),
    default=JSON,
    show_default=True,
    help=f"Beside {RECORD}, and a GLB of the best hands, an array as GraspNet's API or "
    "contact_graspnet has it.",
)
@click.option("--seed", type=SEED, default=0, show_default=True, help=SEED_HELP)
@json_option
@click.option("--overwrite", is_flag=True, help="Replace the files that -o names.")
def command(
    results: Path,
    output: Path | None,
    gripper: str,
    approach: str,
    per_object: int,
    min_score: float,
    friction: float,
    confidence: float,
    avoid_arms: bool,
    layout: str,
    seed: int,
    as_json: bool,
    overwrite: bool,
) -> None:
    """Plan grasps of every object with a parallel-jaw gripper, best first.

    OUT/ is a folder that `brrp reconstruct` wrote. A grasp's score is the probability, by the
    posterior, that the hand comes in without touching the object, closes on it, and holds it by
    friction. Hands that would touch the table or a neighbour are left out. Lengths are metres.

    \b
    Example:
      brrp grasp out/
      brrp grasp out/ --gripper robotiq-2f-85 --approach top-down
      brrp grasp out/ --gripper mine.yaml --format graspnet -o grasps/best.json
    """
    from brrp_cli.api import open_result
    from brrp_cli.files import check_writable, refuse_existing

    if output is not None:
        require_suffix(output, ".json")
        refuse_results(files_of(output, layout))
    hand = open_gripper(gripper)
    for path in [] if output is None else files_of(output, layout):
        refuse_existing(path, overwrite=overwrite)
    stored = open_result(results)
    check_writable((output or stored.folder / RECORD).parent)
    config = replace(
        GraspConfig(),
        friction=friction,
        confidence=confidence,
        surroundings=SurroundingsConfig(arms=avoid_arms),
    )
    with report_of(as_json) as report:
        plan = grasp(
            stored,
            hand,
            output or stored.folder / RECORD,
            layout,
            config=config,
            approach=approach,
            per_object=per_object,
            min_score=min_score,
            seed=seed,
        )
        report |= reported(plan, output or stored.folder / RECORD)


def files_of(record: Path, layout: str) -> list[Path]:
    """The record and, beside it, the hands as a scene and the array in a layout."""
    paths = [record, record.with_suffix(".glb")]
    if layout == JSON:
        return paths
    return [*paths, record.with_suffix(Path(LAYOUTS[layout][0]).suffix)]


def refuse_results(paths: list[Path]) -> None:
    """UsageError for names that files of a reconstruction have: these are never replaced."""
    from brrp_cli.results import write

    theirs = (write.RECORD, write.SCENE, write.FRAME)
    taken = [path.name for path in paths if path.name in theirs]
    if taken:
        raise click.UsageError(
            f"{taken[0]} is a file of `brrp reconstruct`: name the grasps otherwise with -o"
        )


def grasp(
    stored: StoredResult, gripper: Gripper, record: Path, layout: str, **options: Any
) -> GraspPlan:
    """Plan, write, and tell it with a line for each object. Errors: those of `plan_grasps`,
    OutputError."""
    from brrp_cli.files import atomic_path
    from brrp_cli.grasping.drawing import save_glb
    from brrp_cli.grasping.plan import plan_grasps
    from brrp_cli.grasping.record import write_grasps

    plan = plan_grasps(stored, gripper, **options)
    frame = stored.record["frame"]
    paths = files_of(record, layout)
    write_grasps(plan, paths[0], frame, stored.T_frame_cam)
    if plan.grasps:
        with atomic_path(paths[1]) as partial:
            save_glb(plan, partial, frame, stored.T_frame_cam)
    else:
        paths[1].unlink(missing_ok=True)
    if layout != JSON:
        with atomic_path(paths[2]) as partial:
            LAYOUTS[layout][1](plan, partial)
    for each in plan.objects:
        click.echo(f"  {told(each)}")
    held = sum(bool(each.grasps) for each in plan.objects)
    if layout != JSON and frame != "camera":
        note(f"  {paths[2].name} is in the camera frame, as its readers expect")
    written = ", ".join(str(path) for path in paths if path.exists())
    click.echo(
        f"Wrote {counted(len(plan.grasps), 'grasp')} of {held} of"
        f" {counted(len(plan.objects), 'object')}, {gripper.name},"
        f" metres, {frame} frame: {written}"
    )
    return plan


def told(each: ObjectGrasps) -> str:
    """One object's line for people."""
    if not each.grasps:
        return f"object {each.object_id}: no grasp, {each.why}"
    best = each.grasps[0]
    return (
        f"object {each.object_id}: {counted(len(each.grasps), 'grasp')}, the best"
        f" holds with probability {best.score:.2f}, {best.width * 1000:.0f} mm wide"
    )


def reported(plan: GraspPlan, record: Path) -> dict[str, Any]:
    """What --json prints."""
    return {
        "output": str(record),
        "gripper": plan.gripper.name,
        "objects": [
            {
                "id": each.object_id,
                "grasps": len(each.grasps),
                "best_score": each.grasps[0].score if each.grasps else None,
                "why_none": each.why or None,
            }
            for each in plan.objects
        ],
    }
