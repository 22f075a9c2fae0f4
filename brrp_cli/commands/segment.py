"""`brrp segment`: masks made, shown, and corrected by id."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.commands.frame import tell
from brrp_cli.commands.json_option import json_option, report_of
from brrp_cli.commands.made_masks import pictures_of
from brrp_cli.commands.method_options import CONFIG_HELP
from brrp_cli.commands.output_file import require_suffix
from brrp_cli.commands.seed_option import SEED, SEED_HELP
from brrp_cli.commands.source_options import SourceOptions, require_output, source_options
from brrp_cli.errors import FrameError
from brrp_cli.files import refuse_existing
from brrp_cli.progress import note

if TYPE_CHECKING:
    from brrp_cli.frames.frame import Frame


def _ids(ctx: click.Context, option: click.Parameter, values: tuple[str, ...]) -> list[list[int]]:
    try:
        return [[int(part) for part in value.split(",")] for value in values]
    except ValueError:
        raise click.BadParameter("ids are whole numbers with commas: 3,4", ctx, option) from None


def _splits(
    ctx: click.Context, option: click.Parameter, values: tuple[str, ...]
) -> list[tuple[int, int]]:
    found = []
    for value in (part for text in values for part in text.split(",")):
        object_id, _, pieces = value.partition(":")
        try:
            found.append((int(object_id), int(pieces or 2)))
        except ValueError:
            raise click.BadParameter("an id, or ID:PIECES: 5 or 5:3", ctx, option) from None
        if found[-1][1] < 2:
            raise click.BadParameter("at least two pieces", ctx, option)
    return found


@click.command("segment")
@source_options
@click.option("--again", is_flag=True, help="Make new masks although the source has some.")
@click.option(
    "--split",
    "splits",
    multiple=True,
    callback=_splits,
    metavar="ID[:PIECES]",
    help="Cut object ID in two, or in PIECES.",
)
@click.option(
    "--merge",
    "merges",
    multiple=True,
    callback=_ids,
    metavar="ID,ID",
    help="Make these objects one, with the first id.",
)
@click.option(
    "--drop",
    "drops",
    multiple=True,
    callback=_ids,
    metavar="ID",
    help="Make this object background.",
)
@click.option("--config", "file", type=click.Path(path_type=Path), help=CONFIG_HELP)
@click.option("--seed", type=SEED, default=0, show_default=True, help=SEED_HELP)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="FRAME.npz")
@json_option
@click.option("--overwrite", is_flag=True, help="Replace what stands at the output.")
def command(
    source: SourceOptions,
    again: bool,
    splits: list[tuple[int, int]],
    merges: list[list[int]],
    drops: list[list[int]],
    file: Path | None,
    seed: int,
    output: Path | None,
    as_json: bool,
    overwrite: bool,
) -> None:
    """Make masks, show them, and correct them by the ids that the picture shows.

    A source that has masks keeps them unless --again, --prompt or --masks says otherwise. --split
    comes first, and the objects that it makes get the next free ids; then come --merge and --drop.
    Writes FRAME.npz, FRAME.masks.png to look at and FRAME.ids.png (16 bit) for other programs.

    \b
    Example:
      brrp segment --color c.png --depth d.png --intrinsics k.json -o frame.npz
      brrp segment frame.npz --merge 3,4 --split 5 --drop 2 -o frame.npz --overwrite
      brrp segment scene/ --prompt "small object" -o frame.npz
    """
    if source.masks is not None and again:
        raise click.UsageError("--masks and --again exclude each other")
    source.check()
    output = require_output(output)
    require_suffix(output, ".npz")
    if any(len({*ids}) < 2 for ids in merges):
        raise click.UsageError("--merge takes two ids or more: --merge 3,4")
    named = Counter(i for group in [*merges, *drops] for i in {*group})
    if twice := [str(i) for i, times in named.items() if times > 1]:
        raise click.UsageError(f"name an id in one --merge or --drop, not in two: {twice[0]}")
    picture, ids = pictures_of(output)
    for path in (output, picture, ids):
        refuse_existing(path, overwrite=overwrite)

    from brrp_cli.config.segmentation import SegmentConfig
    from brrp_cli.frames.build import require_objects
    from brrp_cli.frames.npz import save_frame
    from brrp_cli.methods.config_file import read_config
    from brrp_cli.results.write import FRAME, RECORD
    from brrp_cli.segmentation import edit_masks
    from brrp_cli.segmentation.mask_picture import fits_ids, write_ids, write_picture

    config = SegmentConfig() if file is None else read_config(file).segmentation()
    frame = source.read()
    made = again or source.prompt is not None or not frame.object_ids
    unused = {"--all": source.keep_all, "--config": file is not None and not splits}
    for option, given in unused.items():
        if given and not made:
            some = "--masks names some" if source.masks is not None else "the source has some"
            fix = "leave out one of them" if source.masks is not None else "add --again"
            raise click.UsageError(f"{option} is of masks that are made, and {some}: {fix}")
    if made:
        frame = source.make_masks(frame, seed, config)
    before = frame
    for object_id, pieces in splits:
        split = edit_masks.split(frame, object_id, pieces, seed, config)
        frame = edit_masks.corrected(frame, split)
    for group in merges:
        frame = edit_masks.corrected(frame, edit_masks.merge(frame, group))
    undropped = frame
    for group in drops:
        frame = edit_masks.corrected(frame, edit_masks.drop(frame, group))
    if undropped.object_ids and not frame.object_ids:
        raise FrameError(
            "There is no object in the mask any more",
            where=frame.source,
            expected="at least one object that is not dropped",
            found=f"--drop takes all {len(undropped.object_ids)}"
            if len(undropped.object_ids) > 1
            else "--drop takes the only one",
            fix="drop fewer, or make new masks with --again",
        )
    with report_of(as_json) as report:
        report["objects"] = _report(require_objects(frame), before)
        write_picture(frame, picture)
        if fits_ids(frame):
            write_ids(frame, ids)
        else:
            ids.unlink(missing_ok=True)
            note(f"{ids} is left out: 16 bits do not hold all ids")
        save_frame(frame, output)
        if (output.parent / RECORD).is_file() and output.name == FRAME:
            note(f"{output.parent}: the results beside it are of the masks before")
        tell(frame.shape, len(frame.object_ids), output, picture)
        report["output"] = str(output)


def _report(frame: Frame, before: Frame) -> list[dict[str, Any]]:
    """A line for each object: what it covers, how large it is, how far away; the same in metres."""
    import numpy as np

    told: list[dict[str, Any]] = []
    click.echo("  id  pixels  with depth  width x height x depth, cm  distance, cm")
    for object_id in frame.object_ids:
        points = frame.object_points(object_id)
        pixels = int((frame.segmap == object_id).sum())
        about: dict[str, Any] = {
            "id": object_id,
            "pixels": pixels,
            "with_depth": len(points) / pixels,
        }
        about["new"] = object_id not in before.object_ids
        size, distance = "no depth", ""
        if len(points):
            about["extents"] = np.ptp(points, axis=0).tolist()
            about["distance"] = float(np.median(points[:, 2]))
            size = " x ".join(f"{extent * 100:.1f}" for extent in about["extents"])
            distance = f"{about['distance'] * 100:.0f}"
        new = "  new" if about["new"] else ""
        share = f"{100 * len(points) / pixels:.0f} %"
        click.echo(f"  {object_id:<3} {pixels:>6}  {share:>10}  {size:<26}  {distance:>12}{new}")
        told.append(about)
    return told
