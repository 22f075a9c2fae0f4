"""`brrp reconstruct FRAME.npz`: a closed mesh of every object, and how sure that is."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brrp_cli.config import PRESETS, preset
from brrp_cli.progress import note
from brrp_cli.retrieval.choose import RETRIEVERS, choose_retriever
from brrp_cli.retrieval.clip_files import CLIP_DIR_VARIABLE

if TYPE_CHECKING:
    from brrp_cli.api import Reconstruction

SOME_FAILED = 3


@click.command("reconstruct")
@click.argument("frame_path", metavar="FRAME.npz", type=click.Path(path_type=Path))
@click.option("--prior", "prior_path", type=click.Path(path_type=Path), help="The prior to use.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="[default: FRAME_brrp/]")
@click.option("--preset", "preset_name", type=click.Choice(list(PRESETS)), default="default")
@click.option("--k", type=click.IntRange(min=1), help="Retrieved objects. [default: the preset's]")
@click.option("--retriever", type=click.Choice(RETRIEVERS), default="auto", show_default=True)
@click.option(
    "--clip-dir",
    type=click.Path(path_type=Path),
    help=f"Folder with CLIP ViT-B/16 as ONNX. [default: {CLIP_DIR_VARIABLE}, else the fetched]",
)
@click.option("--frame", "coordinates", type=click.Choice(["camera", "world"]), default="camera")
@click.option("--depth-scale", type=float, help="Raw depth times this is metres.")
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--device", type=click.Choice(["auto", "cpu", "cuda"]), default="auto")
@click.option("--overwrite", is_flag=True, help="Replace the output folder if it is there.")
def command(
    frame_path: Path,
    prior_path: Path | None,
    output: Path | None,
    preset_name: str,
    k: int | None,
    retriever: str,
    clip_dir: Path | None,
    coordinates: str,
    depth_scale: float | None,
    seed: int,
    device: str,
    overwrite: bool,
) -> None:
    """Turn a segmented RGBD frame into a closed mesh for every object.

    The prior is --prior, else BRRP_PRIOR, else the one in the user's data folder, else the
    starter prior. Meshes are in metres, in the camera frame unless --frame world is given.

    \b
    Example:
      brrp reconstruct frame.npz
      brrp reconstruct frame.npz --prior prior/ --preset paper -o out/ --seed 1
    """
    from brrp_cli.api import reconstruct
    from brrp_cli.frames.readers import read_frame
    from brrp_cli.prior.store import open_prior
    from brrp_cli.surface.results import check_output, write_results
    from brrp_cli.which_prior import locate_prior

    output = output or frame_path.with_name(f"{frame_path.stem}_brrp")
    # What can be refused is refused before the work, not after it.
    frame = read_frame(frame_path, depth_scale=depth_scale)
    check_output(output, frame, coordinates, overwrite=overwrite)
    located, how = locate_prior(prior_path)
    prior = open_prior(located)
    note(f"Prior: {located} ({how}), {len(prior.names)} objects")
    config = preset(preset_name)
    config = replace(config, k=k) if k else config
    chosen = choose_retriever(retriever, prior, config, seed, clip_dir=clip_dir)
    note(f"Retrieval: {chosen.name}")
    result = reconstruct(frame, prior, config=config, retriever=chosen, seed=seed, device=device)
    write_results(result, output, frame=coordinates, overwrite=overwrite)
    report(result)
    done = len(result.reconstructed)
    click.echo(
        f"Wrote {done} of {len(result.objects)} objects, metres, {coordinates} frame: {output}/ "
        "(object_*.ply, scene.glb, posterior.h5, result.json, preview.png)"
    )
    if done < len(result.objects):
        sys.exit(SOME_FAILED)


def report(result: Reconstruction) -> None:
    """Print a line for each object."""
    for item in result.objects:
        best = item.retrieved[0] if item.retrieved else None
        match = f"{best.name} {best.probability:.2f}" if best else ""
        seconds = f"{sum(item.seconds.values()):.1f} s" if item.seconds else ""
        text = "; ".join(part for part in (match, item.message, seconds) if part)
        note(f"  object {item.object_id}: {item.status}  {text}")
