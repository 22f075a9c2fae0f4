"""The methods by name."""

from __future__ import annotations

from brrp_cli.errors import BrrpError
from brrp_cli.methods import brrp, pointsdf, retrieval_only, vprism
from brrp_cli.methods.base import Method

METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        brrp.METHOD,
        retrieval_only.METHOD,
        vprism.METHOD,
        pointsdf.METHOD,
    )
}

# What is run where no method is named, and what `brrp eval` compares.
DEFAULT = brrp.METHOD.name
COMPARED = ",".join((brrp.METHOD.name, vprism.METHOD.name))


def reconstructing() -> list[str]:
    """The names of those that give shapes."""
    return [name for name, method in METHODS.items() if method.gives_shapes]


def preset_names() -> list[str]:
    """The names of all methods' presets, each once."""
    return list(dict.fromkeys(name for method in METHODS.values() for name in method.presets))


def reconstructing_method(name: str) -> Method:
    """The method of that name. Errors: BrrpError if there is none that gives shapes."""
    if name not in reconstructing():
        raise BrrpError("No such method", found=name, expected=", ".join(reconstructing()))
    return METHODS[name]
