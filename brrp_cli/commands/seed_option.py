"""--seed and --device, as every command takes them."""

from __future__ import annotations

import click

SEED = click.IntRange(min=0)
SEED_HELP = "Seed of all randomness: the same seed gives the same bytes."

device_option = click.option(
    "--device",
    type=click.Choice(["auto", "cpu", "cuda"]),
    default="auto",
    show_default=True,
    help="Where inference runs; auto: CUDA where torch finds it.",
)
