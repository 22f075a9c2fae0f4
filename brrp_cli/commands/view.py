"""`brrp view OUT/`: one HTML page that shows results."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

import click

from brrp_cli.commands.output_file import require_suffix
from brrp_cli.commands.results_folder import require_results
from brrp_cli.progress import note

if TYPE_CHECKING:
    from brrp_cli.results.read import StoredResult

PAGE = "view.html"


@click.command("view")
@click.argument("results", metavar="OUT/", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    metavar="PAGE.html",
    type=click.Path(path_type=Path),
    help=f"File to write. [default: OUT/{PAGE}]",
)
@click.option("--open/--no-open", "open_it", default=True, help="Open the page in a browser.")
@click.option(
    "--rerun",
    is_flag=True,
    help="Show in Rerun instead (pip install rerun-sdk); -o FILE.rrd writes.",
)
@click.option("--overwrite", is_flag=True, help="Replace the file that -o names.")
def command(
    results: Path, output: Path | None, open_it: bool, rerun: bool, overwrite: bool
) -> None:
    """Write and open one HTML page that shows the results in OUT/.

    The page holds all that it needs, so that it can be kept, sent and opened without a network:
    the image, the observed points, every object to turn on and off, uncertainty as colour, what
    was retrieved and how sure that is, the collision shapes where `brrp export` wrote some, and the
    best grasps where `brrp grasp` did.
    OUT/view.html is made anew each time; a file that -o names is replaced only with --overwrite.

    \b
    Example:
      brrp view out/
      brrp view out/ --no-open -o page.html
      brrp view out/ --rerun
    """
    from brrp_cli.files import refuse_existing

    if output is not None:
        require_suffix(output, ".rrd" if rerun else ".html")
        refuse_existing(output, overwrite=overwrite)
    require_results(results)

    from brrp_cli.api import open_result

    stored = open_result(results)
    if rerun:
        from brrp_cli.view.rerun import show

        show(stored, output, title(results))
        return
    view(stored, title(results), output or stored.folder / PAGE, open_it=open_it)


def view(stored: StoredResult, title: str, path: Path, *, open_it: bool) -> None:
    """Write the page of results, and open it. Errors: those of `page`."""
    from brrp_cli.files import write_bytes
    from brrp_cli.view.page import page

    text = page(stored, title).encode("utf-8")
    write_bytes(path, text)
    click.echo(f"Wrote {path} ({len(text) / 1e6:.1f} MB)")
    if open_it and not webbrowser.open(path.resolve().as_uri()):
        note("No browser could be opened: open the file yourself")


def title(results: Path) -> str:
    """What the page is called: the folder's name."""
    return results.resolve().name
