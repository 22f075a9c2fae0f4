"""`brrp verify`: check every byte of a prior."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from brrp_cli.commands.json_option import json_option, report_of
from brrp_cli.prior.default import locate_prior
from brrp_cli.spoken import counted


@click.command("verify")
@click.argument("prior", type=click.Path(path_type=Path), required=False)
@json_option
def command(prior: Path | None, as_json: bool) -> None:
    """Check every checksum, shape and type in PRIOR, and list all problems.

    Without PRIOR: BRRP_PRIOR, else the user's data folder, else the starter prior.

    \b
    Example:
      brrp verify prior/

    Exit codes: 0 all is well, 1 there are problems.
    """
    from brrp_cli.prior.store import open_prior, verify_prior

    folder, how = locate_prior(prior)
    opened = open_prior(folder)
    problems = verify_prior(opened)
    counts = (
        f"{counted(len(opened.names), 'object')} in {counted(len(opened.manifest.shards), 'shard')}"
    )
    with report_of(as_json) as report:
        for problem in problems:
            click.echo(problem)
        found = counted(len(problems), "problem") if problems else "all is well"
        click.echo(f"{folder} ({how}): {counts}, {found}")
        report["path"] = str(folder)
        report["objects"] = len(opened.names)
        report["shards"] = len(opened.manifest.shards)
        report["problems"] = problems
    if problems:
        click.echo("fix: run brrp build-prior again on the same meshes", err=True)
        sys.exit(1)
