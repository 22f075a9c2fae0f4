"""`brrp fetch`: bring what brrp can use and does not come with."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

import click

from brrp_cli.retrieval.clip.manifest import PRECISIONS as CLIP_PRECISIONS
from brrp_cli.retrieval.clip.manifest import read_clip_manifest
from brrp_cli.retrieval.clip.model_files import CLIP_DIR_VARIABLE, clip_cache, named_clip_folder
from brrp_cli.segmentation.prompted.mask_files import PRECISIONS as MASK_PRECISIONS
from brrp_cli.segmentation.prompted.mask_files import (
    find_mask_files,
    masks_folder,
    read_mask_manifest,
)
from brrp_cli.spoken import agreed, counted

PRECISIONS = {"clip": CLIP_PRECISIONS, "masks": MASK_PRECISIONS}
MESHES = ("ycb", "household")


@click.command("fetch")
@click.argument("what", type=click.Choice([*PRECISIONS, *MESHES]))
@click.option(
    "--precision",
    type=click.Choice(list(dict.fromkeys([*CLIP_PRECISIONS, *MASK_PRECISIONS]))),
    default="full",
    show_default=True,
    help="clip: full 601 MB, 8bit 154 MB. masks: full 764 MB, 4bit 196 MB. The same weights, "
    "rounded.",
)
@click.option(
    "--clip-dir",
    type=click.Path(path_type=Path),
    help=f"Folder to fill with CLIP. [default: {CLIP_DIR_VARIABLE}, else the user's cache]",
)
@click.option(
    "--masks-dir",
    type=click.Path(path_type=Path),
    help="Folder to fill with the models of masks. [default: BRRP_MASKS_DIR, else the cache]",
)
@click.option(
    "-o",
    "--output",
    "out",
    type=click.Path(path_type=Path),
    help="Folder to fill with meshes. [default: meshes/ycb or meshes/household in the user's data "
    "folder]",
)
@click.option(
    "--from",
    "source",
    metavar="ADDRESS|FOLDER",
    help="Where the files lie, in the layout of the repository (masks: of both, in detector/ and "
    "segmenter/). [default: the Hugging Face hub; meshes: where their authors have them]",
)
def command(
    what: str,
    precision: str,
    clip_dir: Path | None,
    masks_dir: Path | None,
    out: Path | None,
    source: str | None,
) -> None:
    """Bring CLIP ViT-B/16, which retrieves objects by their look; the models that make masks by
    a prompt, Grounding DINO tiny and MobileSAM; or meshes to build a prior from: 57 objects of YCB
    (CC BY 4.0), 224 household objects (CC0).

    Every file is checked against its size and sha256 before it is used. A download that was cut
    goes on when the command is run again. `brrp reconstruct` then uses CLIP by itself. For a
    machine without a network: fetch with --clip-dir, --masks-dir or -o on another one and bring the
    folder.

    \b
    Example:
      brrp fetch clip
      brrp fetch clip --precision 8bit --clip-dir clip/
      brrp fetch masks --precision 4bit
      brrp fetch clip --from https://mirror.example/clip-vit-base-patch16
      brrp fetch household -o household/
    """
    if out is not None and what not in MESHES:
        raise click.UsageError("-o goes with meshes: `brrp fetch ycb`, `brrp fetch household`")
    if what in MESHES and precision != "full":
        raise click.UsageError(f"{what} comes in full precision")
    if what not in MESHES and precision not in PRECISIONS[what]:
        raise click.UsageError(f"{what} comes in {' and '.join(PRECISIONS[what])}")
    if clip_dir is not None and what != "clip":
        raise click.UsageError("--clip-dir goes with `brrp fetch clip`")
    if masks_dir is not None and what != "masks":
        raise click.UsageError("--masks-dir goes with `brrp fetch masks`")
    if what in MESHES:
        _meshes(what, out, source)
    elif what == "clip":
        _clip(precision, clip_dir, source)
    else:
        _masks(precision, masks_dir, source)


def _clip(precision: str, clip_dir: Path | None, source: str | None) -> None:
    from brrp_cli.fetch.fetch import fetch
    from brrp_cli.retrieval.clip.model_files import find_clip_files
    from brrp_cli.retrieval.clip.text import ClipTokenizer

    manifest = read_clip_manifest()
    files = manifest.files[precision]
    folder = named_clip_folder(clip_dir) or clip_cache()
    brought = fetch(files, source or manifest.address, folder)
    ClipTokenizer(find_clip_files(folder).tokenizer)
    size = sum(file.bytes for file in files) / 1e6
    click.echo(
        f"CLIP ViT-B/16, {precision}, {size:.0f} MB: {counted(len(brought), 'file')} fetched, "
        f"{len(files) - len(brought)} there already, all checked: {folder}"
    )


def _masks(precision: str, masks_dir: Path | None, source: str | None) -> None:
    from brrp_cli.fetch.fetch import fetch

    folder = masks_folder(masks_dir)
    brought, files = 0, []
    for repository in read_mask_manifest(precision):
        place = f"{source.rstrip('/')}/{repository.name}" if source else repository.address
        brought += len(fetch(repository.files, place, folder / repository.name))
        files += repository.files
    find_mask_files(folder)
    size = sum(file.bytes for file in files) / 1e6
    click.echo(
        f"Grounding DINO tiny, {precision}, and MobileSAM, {size:.0f} MB:"
        f" {counted(brought, 'file')} fetched, "
        f'{len(files) - brought} there already, all checked: {folder}. Use: --prompt "small object"'
    )


def _meshes(what: str, out: Path | None, source: str | None) -> None:
    from brrp_cli.fetch.meshes import fetch_meshes, read_mesh_set
    from brrp_cli.prior.locate import data_folder
    from brrp_cli.progress import note

    meshes = read_mesh_set(what)
    folder = out or data_folder() / "meshes" / what
    fetched = fetch_meshes(meshes, source, folder)
    if fetched.unchecked:
        several = len(fetched.unchecked)
        note(
            f"{counted(several, 'texture')} {agreed(several, 'has', 'have')} no known sum and"
            f" {agreed(several, 'was', 'were')} taken unchecked, such as {fetched.unchecked[0]}"
        )
    size = sum(file.bytes for file in meshes.files) / 1e6
    there = len(meshes.files) - len(fetched.brought)
    click.echo(
        f"{meshes.title} ({meshes.licence}), {size:.0f} MB:"
        f" {counted(len(fetched.brought), 'file')} fetched, "
        f"{there} there already, {'' if fetched.unchecked else 'all '}checked: {folder}. "
        f"Use: brrp build-prior {quote(str(folder))}"
    )
