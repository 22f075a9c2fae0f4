"""`brrp fetch`: bring what brrp can use and does not come with."""

from __future__ import annotations

from pathlib import Path

import click

from brrp_cli.retrieval.clip_files import CLIP_DIR_VARIABLE, clip_cache, named_clip_folder


@click.command("fetch")
@click.argument("what", type=click.Choice(["clip"]))
@click.option(
    "--precision",
    type=click.Choice(["full", "8bit"]),
    default="full",
    show_default=True,
    help="full: 601 MB. 8bit: 154 MB, the same weights rounded.",
)
@click.option(
    "--clip-dir",
    type=click.Path(path_type=Path),
    help=f"Folder to fill. [default: {CLIP_DIR_VARIABLE}, else the user's cache]",
)
@click.option(
    "--from",
    "source",
    metavar="ADDRESS|FOLDER",
    help="Where the files lie, in the layout of the repository. [default: the Hugging Face hub]",
)
def command(what: str, precision: str, clip_dir: Path | None, source: str | None) -> None:
    """Bring CLIP ViT-B/16, which retrieves objects by their look.

    Every file is checked against its size and sha256 before it is used. A download that was cut
    goes on when the command is run again. `brrp reconstruct` then uses CLIP by itself. For a
    machine without a network: fetch with --clip-dir on another one and bring the folder.

    \b
    Example:
      brrp fetch clip
      brrp fetch clip --precision 8bit --clip-dir clip/
      brrp fetch clip --from https://mirror.example/clip-vit-base-patch16
    """
    from brrp_cli.fetch.fetch import fetch
    from brrp_cli.retrieval.clip_files import find_clip_files
    from brrp_cli.retrieval.clip_manifest import read_clip_manifest
    from brrp_cli.retrieval.clip_text import ClipTokenizer

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
