"""`brrp prior`: keep a prior. Add objects, remove them, merge priors, list them, show one."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.commands.build_prior import keep_descriptions, told_failures
from brrp_cli.commands.exit_codes import SOME_FAILED
from brrp_cli.commands.json_option import json_option, report_of
from brrp_cli.commands.output_file import require_suffix
from brrp_cli.prior.default import locate_prior
from brrp_cli.prior.locate import output_prior
from brrp_cli.progress import note, quiet
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.prior.build.build import BuildReport
    from brrp_cli.prior.objects import PriorObject

prior_option = click.option(
    "--prior",
    type=click.Path(path_type=Path),
    help="The prior. [default: BRRP_PRIOR, else the one in the user's data folder]",
)
# Of what only reads it.
read_prior_option = click.option(
    "--prior",
    type=click.Path(path_type=Path),
    help="The prior. [default: BRRP_PRIOR, else the one in the user's data folder, else the"
    " starter prior]",
)
clip_option = click.option(
    "--clip-dir",
    type=click.Path(path_type=Path),
    help="Folder with CLIP, whose text embeddings are kept with the prior.",
)


@click.group("prior")
def command() -> None:
    """Keep a prior: add objects, remove them, merge priors, look at what is there.

    What stays is not built again, and the result has the bytes that a build of all meshes together
    would have. `brrp build-prior` in place of these makes a prior mirror folders of meshes.

    \b
    Example:
      brrp prior list
      brrp prior add meshes/mug.obj --prior prior/
      brrp prior show mug --prior prior/
    """


@command.command("add")
@click.argument("meshes", type=click.Path(path_type=Path), nargs=-1, required=True)
@prior_option
@click.option(
    "--descriptions",
    type=click.Path(path_type=Path),
    help="TOML, JSON or CSV: name -> short phrase, such as 'a red cracker box'.",
)
@click.option("--replace", is_flag=True, help="Take new meshes for objects that are there.")
@click.option(
    "--workers", type=click.IntRange(1), help="Processes; as many as processors if not said."
)
@clip_option
def add(
    meshes: tuple[Path, ...],
    prior: Path | None,
    descriptions: Path | None,
    replace: bool,
    workers: int | None,
    clip_dir: Path | None,
) -> None:
    """Add the objects of MESHES to the prior, with the parameters that it was built with.

    Each of MESHES is a folder as `brrp build-prior` takes it, the folder of one object, or a mesh
    file.

    \b
    Example:
      brrp prior add new/ --prior prior/
      brrp prior add mug.obj drill.glb

    Exit codes: 0 all meshes are in, 3 some failed.
    """
    from brrp_cli.prior.build.edit import add_objects

    folder, how = output_prior(prior)
    note(f"Prior: {folder} ({how.replace('-o', '--prior')})")
    report = add_objects(
        folder,
        meshes,
        descriptions=descriptions,
        replace=replace,
        workers=workers,
        progress=not quiet(),
    )
    told_failures(report.failed)
    click.echo(f"{counted(len(report.made), 'object')} made; {_total(report)}")
    keep_descriptions(report.path, clip_dir)
    if report.failed:
        sys.exit(SOME_FAILED)


@command.command("remove")
@click.argument("names", nargs=-1, required=True)
@prior_option
def remove(names: tuple[str, ...], prior: Path | None) -> None:
    """Remove the objects NAMES from the prior. Of a mesh that failed nothing is told any more.

    \b
    Example:
      brrp prior remove 025_mug 024_bowl --prior prior/
    """
    from brrp_cli.prior.build.edit import remove_objects

    folder, how = output_prior(prior)
    note(f"Prior: {folder} ({how.replace('-o', '--prior')})")
    report = remove_objects(folder, names)
    # An object whose new mesh failed is both.
    failed = [name for name in report.forgotten if name not in report.removed]
    done = [f"{counted(len(report.removed), 'object')} removed"] * bool(report.removed)
    done += [f"{counted(len(failed), 'failed mesh', 'failed meshes')} forgotten"] * bool(failed)
    click.echo(f"{', '.join(done)}; {_total(report)}")
    keep_descriptions(report.path, None)


@command.command("merge")
@click.argument("priors", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option(
    "-o", "--output", "out", type=click.Path(path_type=Path), required=True, help="Folder to fill."
)
@click.option("--overwrite", is_flag=True, help="Replace another prior that is there.")
@clip_option
def merge(priors: tuple[Path, ...], out: Path, overwrite: bool, clip_dir: Path | None) -> None:
    """Make one prior of PRIORS, which were built with the same parameters.

    The output may be one of PRIORS: the objects of the others are added to it.

    \b
    Example:
      brrp prior merge ycb-prior/ household-prior/ -o prior/
    """
    from brrp_cli.prior.build.edit import merge_priors

    report = merge_priors(priors, out, overwrite=overwrite)
    click.echo(f"{counted(len(priors), 'prior')} merged; {_total(report)}")
    keep_descriptions(report.path, clip_dir)


@command.command("list")
@read_prior_option
@json_option
def list_objects(prior: Path | None, as_json: bool) -> None:
    """Print the name and the phrase of each object, with a tab between them.

    `brrp info` prints more of each.

    \b
    Example:
      brrp prior list --prior prior/
    """
    from brrp_cli.prior.store import open_prior

    folder, how = locate_prior(prior)
    opened = open_prior(folder)
    with report_of(as_json) as report:
        report["objects"] = dict(zip(opened.names, opened.phrases, strict=True))
        for name, phrase in report["objects"].items():
            if not as_json:
                click.echo(f"{name}\t{phrase}")
    note(f"{counted(len(opened.names), 'object')}: {folder} ({how})")


@command.command("show")
@click.argument("name")
@read_prior_option
@click.option(
    "-o",
    "--output",
    "out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="PNG to write: the object in its colours, in its most probable resting pose.",
)
@click.option("--overwrite", is_flag=True, help="Replace a picture that is there.")
def show(name: str, prior: Path | None, out: Path | None, overwrite: bool) -> None:
    """Show the object NAME: its phrase, sizes, resting poses, repair and picture.

    \b
    Example:
      brrp prior show 025_mug --prior prior/ -o mug.png
    """
    from brrp_cli.files import refuse_existing
    from brrp_cli.prior.names import unknown_object
    from brrp_cli.prior.store import open_prior

    if out is not None:
        require_suffix(out, ".png")
    folder, _ = locate_prior(prior)
    opened = open_prior(folder)
    if name not in opened.index.rows:
        raise unknown_object(name, opened.names, folder)
    if out is not None:
        refuse_existing(out, overwrite=overwrite)
    item = opened.load(name)
    for label, text in _told(item, opened.entries[name].source):
        click.echo(f"{label:<13}{text}")
    if out is not None:
        _write_portrait(item, out)
        click.echo(f"picture written to {out}")


def _told(item: PriorObject, source: str) -> list[tuple[str, str]]:
    record: dict[str, Any] = item.record
    poses = [
        (
            "resting pose" if row == 0 else "",
            f"{100 * pose.probability:5.1f} %, {_centimetres(size[:1])} high on "
            f"{_centimetres(size[1:])}",
        )
        for row, (pose, size) in enumerate(zip(item.poses, item.appearance.sizes, strict=True))
    ]
    return [
        ("name", item.name),
        ("phrase", item.description),
        ("mesh", f"{source}, {record['faces']['original']} faces"),
        ("size", f"{_centimetres(record['extents'])}, {1e6 * record['volume']:.0f} cm3"),
        ("colours", "yes" if record["coloured"] else "no"),
        ("repair", "; ".join(record["repair"]["steps"]) or "closed already"),
        *poses,
    ]


def _centimetres(lengths: Any) -> str:
    return " x ".join(f"{100 * length:.1f}" for length in lengths) + " cm"


def _write_portrait(item: PriorObject, path: Path) -> None:
    from PIL import Image

    from brrp_cli.files import atomic_path
    from brrp_cli.rendering.portrait import portrait

    picture = portrait(item)
    with atomic_path(path) as partial:
        Image.fromarray(picture).save(partial, format="PNG")


def _total(report: BuildReport) -> str:
    manifest = report.manifest
    size = sum(shard.bytes for shard in manifest.shards) / 1e6
    return (
        f"{counted(len(manifest.objects), 'object')} now in"
        f" {counted(len(manifest.shards), 'shard')}, {size:.1f} MB: "
        f"{report.path}"
    )
