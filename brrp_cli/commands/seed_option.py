"""What --seed takes in every command."""

from __future__ import annotations

import click

SEED = click.IntRange(min=0)
