"""Objects that stay out of training and priors: data_manifests/household_held_out.toml."""

from __future__ import annotations

import tomllib
from pathlib import Path

from brrp_cli.errors import MeshError

MANIFEST = Path(__file__).resolve().parents[2] / "data_manifests" / "household_held_out.toml"
# Both, all but the held-out ones, and the held-out ones alone.
MIXED, LEAVE, TAKE = "mixed", "leave", "take"


def held_out_names() -> frozenset[str]:
    """Names of mesh files, without their endings."""
    return frozenset(tomllib.loads(MANIFEST.read_text())["held_out"])


def chosen(meshes: list[Path], choice: str) -> list[Path]:
    """The mesh files that `choice` allows. Errors: MeshError if none is left."""
    held = held_out_names()
    found = [path for path in meshes if choice == MIXED or (path.stem in held) == (choice == TAKE)]
    if not found:
        raise MeshError("No mesh to make scenes of", found=f"none with --held-out {choice}")
    return found
