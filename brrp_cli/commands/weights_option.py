"""`--weights`: what a learned method was trained to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from brrp_cli.methods.pointsdf.weights import describe_weights
from brrp_cli.methods.registry import METHODS


def check_weights(methods: Sequence[str], weights: Sequence[Path]) -> None:
    """UsageError unless weights are given where a method was trained, and only there; WeightsError
    for a file that cannot be used."""
    trained = [name for name in methods if METHODS[name].uses_weights]
    if trained and not weights:
        raise click.UsageError(f"--method {trained[0]} needs --weights FILE")
    if weights and not trained:
        raise click.UsageError(
            f"--weights means nothing to --method {','.join(methods)}, so leave it out"
        )
    for path in weights:
        describe_weights(path)
