"""`brrp frame`: what people have, turned into a frame file."""

from __future__ import annotations

from pathlib import Path

import click

from brrp_cli.errors import FrameError, OutputError


@click.command("frame")
@click.argument("source", type=click.Path(path_type=Path), required=False)
@click.option("--color", type=click.Path(path_type=Path), help="Colour image (PNG, JPEG).")
@click.option(
    "--depth",
    type=click.Path(path_type=Path),
    help="Depth aligned to it: 16-bit PNG, TIFF or .npy. Integers are millimetres, floats metres.",
)
@click.option(
    "--intrinsics",
    type=click.Path(path_type=Path),
    help="JSON: fx, fy and cx, cy (ppx, ppy; x_offset, y_offset), a 3 x 3 K, a ROS camera_info.",
)
@click.option(
    "--masks", type=click.Path(path_type=Path), help="Object ids: grey PNG or .npy, 0 = background."
)
@click.option("--segment", is_flag=True, help="Find what stands free on the table, without masks.")
@click.option("--depth-scale", type=float, help="Metres that one unit of depth is.")
@click.option("--seed", default=0, show_default=True, help="Seed of the plane search.")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="FRAME.npz")
@click.option("--overwrite", is_flag=True, help="Replace what stands at the output.")
def command(
    source: Path | None,
    color: Path | None,
    depth: Path | None,
    intrinsics: Path | None,
    masks: Path | None,
    segment: bool,
    depth_scale: float | None,
    seed: int,
    output: Path,
    overwrite: bool,
) -> None:
    """Turn colour and depth images, or the folder SOURCE, into a frame for `brrp reconstruct`.

    SOURCE is one of BRRP's real scenes (rgb.jpg, xyz.npy, segmentation.npy), one view of a
    published scene (rgb.jpg, depth.npy, camera.npz, seg_mask.npy), or an .npz with depth and K,
    or xyz. With --segment a picture of the masks is written beside the frame.

    \b
    Example:
      brrp frame --color c.png --depth d.png --intrinsics k.json --segment -o frame.npz
      brrp frame scene_03/ -o frame.npz
    """
    images = {"--color": color, "--depth": depth, "--intrinsics": intrinsics}
    given = [name for name, path in images.items() if path is not None]
    if source is not None and (given or masks is not None):
        raise click.UsageError("give either SOURCE or --color, --depth and --intrinsics")
    if source is None and len(given) < len(images):
        lacking = ", ".join(name for name in images if name not in given)
        raise click.UsageError(f"missing {lacking} (or give a folder as SOURCE)")
    if masks is not None and segment:
        raise click.UsageError("--masks and --segment exclude each other")
    if output.suffix != ".npz":
        raise click.UsageError(f"-o must end in .npz, not {output.name!r}")
    picture = output.with_suffix(".masks.png")
    for path in (output, picture) if segment else (output,):
        if path.exists() and not overwrite:
            raise OutputError(
                "The output exists already",
                where=path,
                fix="pass --overwrite to replace it, or choose another file with -o",
            )

    from brrp_cli.frames.build import require_objects
    from brrp_cli.frames.images import read_images
    from brrp_cli.frames.npz import save_frame
    from brrp_cli.frames.readers import read_frame

    if source is not None:
        frame = read_frame(source, depth_scale=depth_scale)
    elif color is not None and depth is not None and intrinsics is not None:
        frame = read_images(color, depth, intrinsics, masks, depth_scale=depth_scale)
    if segment:
        from dataclasses import replace

        from brrp_cli.frames.picture import write_picture
        from brrp_cli.frames.segment import segment as find_objects

        frame = require_objects(replace(frame, segmap=find_objects(frame, seed)))
        write_picture(frame, picture)
    elif not frame.object_ids and masks is None and source is None:
        raise FrameError(
            "The frame has no masks",
            where=depth,
            expected="--masks with object ids, or --segment",
            fix="add --segment to find what stands on the table",
        )
    save_frame(require_objects(frame), output)
    _tell(frame.shape, len(frame.object_ids), output, picture if segment else None)


def _tell(shape: tuple[int, int], objects: int, output: Path, picture: Path | None) -> None:
    beside = f"; look at {picture}" if picture is not None else ""
    plural = "" if objects == 1 else "s"
    click.echo(
        f"Wrote {output} ({shape[1]} x {shape[0]}, {objects} object{plural}){beside}."
        f" Next: brrp reconstruct {output}"
    )
