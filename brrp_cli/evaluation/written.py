"""The mesh that `brrp reconstruct` would write, of methods that give a posterior alone."""

from __future__ import annotations

from dataclasses import replace

from brrp_cli.errors import BrrpError
from brrp_cli.evaluation.variants import Variant
from brrp_cli.methods.registry import METHODS
from brrp_cli.reconstruction import FAILED, NO_SURFACE, ObjectReconstruction
from brrp_cli.surface.extract import extract_surface
from brrp_cli.timing import timed


def with_surface(item: ObjectReconstruction, variant: Variant) -> ObjectReconstruction:
    """The object with its surface, and the seconds that it took, or with why it has none;
    unchanged where it has one, or no posterior."""
    if item.surface is not None or item.posterior is None or item.observed is None:
        return item
    level = METHODS[variant.method].level(variant.config)
    config = replace(variant.config.surface, level=level)
    seconds = dict(item.seconds)
    try:
        with timed(seconds, "surface"):
            surface = extract_surface(item.posterior, item.observed, config)
    except BrrpError as error:
        return replace(item, status=FAILED, message=str(error))
    status = item.status if surface is not None else NO_SURFACE
    return replace(item, status=status, surface=surface, seconds=seconds)
