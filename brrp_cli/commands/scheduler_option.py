"""The option `--scheduler`, of commands whose work a Dask cluster can do."""

from __future__ import annotations

import click

scheduler_option = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Work on a Dask cluster with a shared folder: tcp://HOST:PORT, its scheduler file "
    "(.json), or local:N, which starts N workers here. [default: processes here]",
)
