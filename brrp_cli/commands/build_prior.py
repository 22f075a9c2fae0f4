"""`brrp build-prior`: meshes to a prior."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brrp_cli.commands.exit_codes import SOME_FAILED
from brrp_cli.commands.scheduler_option import scheduler_option
from brrp_cli.commands.seed_option import SEED, SEED_HELP
from brrp_cli.errors import BrrpError
from brrp_cli.prior.locate import output_prior
from brrp_cli.prior.parameters import UNITS, BuildParameters
from brrp_cli.progress import note, quiet
from brrp_cli.retrieval.clip.model_files import clip_folder
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.prior.manifest import Failure


@click.command("build-prior")
@click.argument("meshes", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("-o", "--output", "out", type=click.Path(path_type=Path), help="Folder of the prior.")
@click.option(
    "--descriptions",
    type=click.Path(path_type=Path),
    help="TOML, JSON or CSV: name -> short phrase, such as 'a red cracker box'.",
)
@click.option("--units", type=click.Choice(list(UNITS)), default="m", help="Unit of the meshes.")
@click.option(
    "--samples",
    type=click.IntRange(100, 1_000_000),
    default=BuildParameters.samples,
    show_default=True,
    help="Labelled samples for each object.",
)
@click.option("--seed", type=SEED, default=0, show_default=True, help=SEED_HELP)
@click.option(
    "--workers", type=click.IntRange(1), help="Processes; as many as processors if not said."
)
@scheduler_option
@click.option(
    "--clip-dir",
    type=click.Path(path_type=Path),
    help="Folder with CLIP, whose text embeddings are kept with the prior.",
)
@click.option("--overwrite", is_flag=True, help="Replace a prior that has other parameters.")
def command(
    meshes: tuple[Path, ...],
    out: Path | None,
    descriptions: Path | None,
    units: str,
    samples: int,
    seed: int,
    workers: int | None,
    scheduler: str | None,
    clip_dir: Path | None,
    overwrite: bool,
) -> None:
    """Turn the meshes in the folder MESHES, or in several folders, into a prior.

    MESHES holds files (OBJ, PLY, STL, OFF, GLB), or folders such as those of the YCB archive
    (NNN_name/google_16k/textured.obj). A second run does only what is missing or changed. Without
    -o the prior goes to BRRP_PRIOR, else to the user's data folder.

    \b
    Example:
      brrp build-prior ycb/ household/ -o prior/
      brrp build-prior bop/models/ --units mm --descriptions names.csv
      brrp build-prior meshes/ -o prior/ --scheduler tcp://10.0.0.1:8786

    Exit codes: 0 all meshes are in, 3 some failed, 1 none.
    """
    from brrp_cli.prior.build.build import build_prior

    folder, how = output_prior(out)
    note(f"Prior: {folder} ({how})")
    report = build_prior(
        meshes,
        folder,
        BuildParameters(seed=seed, units=units, samples=samples),
        descriptions=descriptions,
        workers=workers,
        scheduler=scheduler,
        overwrite=overwrite,
        progress=not quiet(),
    )
    manifest = report.manifest
    told_failures(manifest.failed)
    if report.removed:
        click.echo(f"no longer among the meshes, so removed: {', '.join(report.removed)}", err=True)
    size = sum(shard.bytes for shard in manifest.shards) / 1e6
    click.echo(
        f"{counted(len(manifest.objects), 'object')} ({len(report.made)} made,"
        f" {len(report.kept)} kept, {len(manifest.failed)} failed)"
        f" in {counted(len(manifest.shards), 'shard')}, {size:.1f} MB, "
        f"written to {report.path}"
    )
    keep_descriptions(report.path, clip_dir)
    if manifest.failed:
        sys.exit(SOME_FAILED)


def told_failures(failed: Iterable[Failure]) -> None:
    """One line on stderr for each mesh that did not become an object."""
    for failure in failed:
        click.echo(f"failed: {failure.source}: {failure.reason}", err=True)


def keep_descriptions(folder: Path, clip_dir: Path | None) -> None:
    """Let CLIP read the descriptions now, where there is CLIP: later its vision model is enough."""
    clip = clip_folder(clip_dir)
    if clip is None:
        return
    from brrp_cli.prior.store import open_prior
    from brrp_cli.retrieval.clip.retriever import keep_descriptions

    try:
        keep_descriptions(open_prior(folder), clip)
    except BrrpError as error:
        # The prior is there and whole; only who asked for CLIP has to know at once.
        if clip_dir is not None:
            raise
        note(f"CLIP's text embeddings are not kept with the prior: {error.what}")
