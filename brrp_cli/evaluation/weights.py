"""Files of weights that an evaluation compares: their names, their training and their digests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from brrp_cli.errors import WeightsError
from brrp_cli.files import sha256_file
from brrp_cli.methods.registry import METHODS


def described_weights(
    methods: Sequence[str], weights: Mapping[str, Path]
) -> dict[str, dict[str, Any]]:
    """What each file says of its training. Errors: WeightsError for one that cannot be used."""
    describers = (METHODS[name].describe_weights for name in methods if name in METHODS)
    return {
        name: describe(path)
        for describe in describers
        if describe is not None
        for name, path in weights.items()
    }


def named_weights(methods: Sequence[str], given: Sequence[Path]) -> dict[str, Path]:
    """Weights by the names of their files, which stand for them in tables: those that are given,
    else those that the methods bring.

    Errors: WeightsError for two of one name.
    """
    own = (METHODS[name].own_weights for name in methods if name in METHODS)
    found: dict[str, Path] = {}
    for path in given or [path for path in own if path is not None]:
        if path.stem in found:
            raise WeightsError(
                "Two files of weights have one name",
                where=path,
                found=found[path.stem],
                fix="rename one: the name tells them apart in the tables",
            )
        found[path.stem] = path
    return found


def weights_digests(weights: Mapping[str, Path]) -> dict[str, Any]:
    """Nothing where there are none, so that runs without weights stay what they were."""
    digests = {name: sha256_file(path) for name, path in weights.items()}
    return {"weights": digests} if digests else {}
