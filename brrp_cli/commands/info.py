"""`brrp info`: what a prior holds and how it was made."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.prior.default import locate_prior
from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.prior.manifest import ObjectEntry


@click.command("info")
@click.argument("prior", type=click.Path(path_type=Path), required=False)
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def command(prior: Path | None, as_json: bool) -> None:
    """Show the objects of PRIOR, their sizes and how they were made.

    Without PRIOR: BRRP_PRIOR, else the user's data folder, else the starter prior.

    \b
    Example:
      brrp info prior/
      brrp info prior/ --json
    """
    from brrp_cli.prior.store import open_prior

    folder, how = locate_prior(prior)
    opened = open_prior(folder)
    manifest = opened.manifest
    if as_json:
        table: dict[str, Any] = json.loads(manifest.as_bytes())
        click.echo(json.dumps({"path": str(folder), "digest": opened.digest, **table}, indent=1))
        return
    head = ("object", "description", "size (cm)", "inside", "poses", "repair")
    rows = [head, *(_row(entry) for entry in manifest.objects)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(head) - 1)]
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        click.echo("  ".join([*cells, row[-1]]).rstrip())
    for failure in manifest.failed:
        click.echo(f"failed: {failure.source}: {failure.reason}")
    size = sum(shard.bytes for shard in manifest.shards) / 1e6
    parameters = opened.parameters
    click.echo(f"\n{folder} ({how})")
    click.echo(
        f"{counted(len(manifest.objects), 'object')} in"
        f" {counted(len(manifest.shards), 'shard')}, {size:.1f} MB"
    )
    click.echo(
        f"seed {parameters['seed']}, {parameters['samples']} samples an object, "
        f"units {parameters['units']}, {len(parameters['features']['scales'])} scales"
    )
    versions = (f"{name} {', '.join(v)}" for name, v in manifest.libraries.items())
    click.echo(f"made with {', '.join(versions)}")
    click.echo(f"digest {opened.digest}")


def _row(entry: ObjectEntry) -> tuple[str, ...]:
    record = entry.record
    return (
        entry.name,
        entry.description,
        " x ".join(f"{100 * extent:.1f}" for extent in record["extents"]),
        f"{100 * record['inside_share']:.0f} %",
        str(record["poses"]),
        _repair(record["repair"]),
    )


def _repair(repair: dict[str, Any]) -> str:
    if not repair["steps"]:
        return "closed already"
    far = max(repair[way]["max"] for way in ("original_to_repaired", "repaired_to_original"))
    return f"{'; '.join(repair['steps'])} (moved {1e3 * far:.1f} mm at most)"
