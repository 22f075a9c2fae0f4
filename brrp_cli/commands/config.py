"""`brrp config`: every number that decides a result."""

from __future__ import annotations

from pathlib import Path

import click

from brrp_cli.commands.method_options import OneOf
from brrp_cli.methods.registry import DEFAULT, METHODS, preset_names


@click.group("config")
def command() -> None:
    """Show every number that decides a result.

    \b
    Example:
      brrp config show
      brrp config show --preset paper > mine.toml
      brrp reconstruct frame.npz --config mine.toml
    """


@command.command("show")
@click.option(
    "--method",
    type=OneOf(lambda: list(METHODS)),
    default=DEFAULT,
    show_default=True,
    help="Method to show.",
)
@click.option(
    "--preset",
    type=OneOf(preset_names),
    help="A named configuration of the method. [default: its first]",
)
@click.option(
    "--config", "file", type=click.Path(path_type=Path), help="TOML whose changes are shown, too."
)
def show(method: str, preset: str | None, file: Path | None) -> None:
    """Print a configuration as TOML, which --config of other commands takes, whole or in part.

    Lengths are metres, angles degrees unless the name says otherwise; brrp_cli/config/ says what
    each number means.

    \b
    Example:
      brrp config show --method vprism
      brrp config show --config mine.toml
    """
    from brrp_cli.config.segmentation import SegmentConfig
    from brrp_cli.methods.config_file import as_toml, read_config

    chosen = METHODS[method]
    config, segmentation = chosen.preset(preset if file is None else None), SegmentConfig()
    if file is not None:
        read = read_config(file)
        config, segmentation = read.config(chosen, preset), read.segmentation()
    click.echo(as_toml(chosen, config, segmentation), nl=False)
