"""`brrp frame`: what people have, turned into a frame file."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

import click

from brrp_cli.commands.made_masks import forget, pictures_of
from brrp_cli.commands.output_file import require_suffix
from brrp_cli.commands.seed_option import SEED
from brrp_cli.commands.source_options import (
    SourceOptions,
    require_output,
    source_options,
    tell_replaced,
)
from brrp_cli.errors import FrameError
from brrp_cli.files import refuse_existing
from brrp_cli.spoken import counted


@click.command("frame")
@source_options
@click.option("--segment", is_flag=True, help="Find what stands on the table, without masks.")
@click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of the plane search.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="FRAME.npz")
@click.option("--overwrite", is_flag=True, help="Replace what stands at the output.")
def command(
    source: SourceOptions, segment: bool, seed: int, output: Path | None, overwrite: bool
) -> None:
    """Turn colour and depth images, or SOURCE, into a frame for `brrp reconstruct`.

    SOURCE is a folder or file of a known format: a frame file (.npz), one of BRRP's real scenes,
    a view of a published scene, a BOP data set, a TUM sequence, a RealSense or Azure Kinect
    recording, a folder of images, a ROS bag. With --segment or --prompt a picture of the masks is
    written beside the frame.

    \b
    Example:
      brrp frame --color c.png --depth d.png --intrinsics k.json --segment -o frame.npz
      brrp frame bop/ycbv/test --list
      brrp frame bop/ycbv/test --index 000048/1 -o frame.npz
      brrp frame recording.bag --index 30 --prompt "small object" -o frame.npz
    """
    makes_masks = segment or source.prompt is not None
    if source.masks is not None and segment:
        raise click.UsageError("--masks and --segment exclude each other")
    if source.keep_all and not segment:
        raise click.UsageError("--all is of masks that are made: add --segment")
    if segment and source.prompt is not None:
        raise click.UsageError("--segment uses no model: leave it out beside --prompt")
    output = require_output(output)
    require_suffix(output, ".npz")
    source.check()
    picture, ids = pictures_of(output)
    replaced = output.exists()
    for path in [output, picture] if makes_masks else [output]:
        refuse_existing(path, overwrite=overwrite)

    from brrp_cli.frames.build import require_objects
    from brrp_cli.frames.npz import save_frame
    from brrp_cli.segmentation.mask_picture import write_picture

    frame = source.read()
    if makes_masks:
        tell_replaced(frame)
        frame = require_objects(source.make_masks(frame, seed))
        write_picture(frame, picture)
    elif not frame.object_ids and source.masks is None:
        raise FrameError(
            "The frame has no masks",
            where=frame.source,
            expected="--masks with object ids, --segment or --prompt",
            fix="add --segment to find what stands on the table",
        )
    save_frame(require_objects(frame), output)
    if replaced:
        forget([ids] if makes_masks else [picture, ids], source)
    tell(frame.shape, len(frame.object_ids), output, picture if makes_masks else None)


def tell(shape: tuple[int, int], objects: int, output: Path, picture: Path | None) -> None:
    """Say what was written and what to do with it."""
    beside = f"; look at {picture}" if picture is not None else ""
    click.echo(
        f"Wrote {output} ({shape[1]} x {shape[0]}, {counted(objects, 'object')}){beside}."
        f" Next: brrp reconstruct {quote(str(output))}"
    )
