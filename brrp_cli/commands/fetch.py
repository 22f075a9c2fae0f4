"""`brrp fetch`: bring what brrp can use and does not come with."""

from __future__ import annotations

from pathlib import Path

import click

from brrp_cli.retrieval.clip.model_files import CLIP_DIR_VARIABLE, clip_cache, named_clip_folder

PRECISIONS = {"clip": ("full", "8bit"), "masks": ("full", "4bit")}


@click.command("fetch")
@click.argument("what", type=click.Choice(list(PRECISIONS)))
@click.option(
    "--precision",
    type=click.Choice(["full", "8bit", "4bit"]),
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
    "--from",
    "source",
    metavar="ADDRESS|FOLDER",
    help="Where the files lie, in the layout of the repository (masks: of both, in detector/ and "
    "segmenter/). [default: the Hugging Face hub]",
)
def command(
    what: str, precision: str, clip_dir: Path | None, masks_dir: Path | None, source: str | None
) -> None:
    """Bring CLIP ViT-B/16, which retrieves objects by their look, or the models that make masks by
    a prompt: Grounding DINO tiny and MobileSAM.

    Every file is checked against its size and sha256 before it is used. A download that was cut
    goes on when the command is run again. `brrp reconstruct` then uses CLIP by itself. For a
    machine without a network: fetch with --clip-dir or --masks-dir on another one and bring the
    folder.

    \b
    Example:
      brrp fetch clip
      brrp fetch clip --precision 8bit --clip-dir clip/
      brrp fetch masks --precision 4bit
      brrp fetch clip --from https://mirror.example/clip-vit-base-patch16
    """
    if precision not in PRECISIONS[what]:
        raise click.UsageError(f"{what} comes in {' and '.join(PRECISIONS[what])}")
    if clip_dir is not None and what != "clip":
        raise click.UsageError("--clip-dir goes with `brrp fetch clip`")
    if masks_dir is not None and what != "masks":
        raise click.UsageError("--masks-dir goes with `brrp fetch masks`")
    if what == "clip":
        _clip(precision, clip_dir, source)
    else:
        _masks(precision, masks_dir, source)


def _clip(precision: str, clip_dir: Path | None, source: str | None) -> None:
    from brrp_cli.fetch.fetch import fetch
    from brrp_cli.retrieval.clip.manifest import read_clip_manifest
    from brrp_cli.retrieval.clip.model_files import find_clip_files
    from brrp_cli.retrieval.clip.text import ClipTokenizer

    manifest = read_clip_manifest()
    files = manifest.files[precision]
    folder = named_clip_folder(clip_dir) or clip_cache()
    brought = fetch(files, source or manifest.address, folder)
    ClipTokenizer(find_clip_files(folder).tokenizer)
    size = sum(file.bytes for file in files) / 1e6
    click.echo(
        f"CLIP ViT-B/16, {precision}, {size:.0f} MB: {len(brought)} files fetched, "
        f"{len(files) - len(brought)} there already, all checked: {folder}"
    )


def _masks(precision: str, masks_dir: Path | None, source: str | None) -> None:
    from brrp_cli.fetch.fetch import fetch
    from brrp_cli.segmentation.prompted.mask_files import (
        find_mask_files,
        masks_folder,
        read_mask_manifest,
    )

    folder = masks_folder(masks_dir)
    brought, files = 0, []
    for repository in read_mask_manifest(precision):
        place = f"{source.rstrip('/')}/{repository.name}" if source else repository.address
        brought += len(fetch(repository.files, place, folder / repository.name))
        files += repository.files
    find_mask_files(folder)
    size = sum(file.bytes for file in files) / 1e6
    click.echo(
        f"Grounding DINO tiny, {precision}, and MobileSAM, {size:.0f} MB: {brought} files fetched, "
        f'{len(files) - brought} there already, all checked: {folder}. Use: --prompt "small object"'
    )
