"""Which objects of the prior the true objects of scenes are: by content, then by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from brrp_cli.errors import MeshError
from brrp_cli.ground_truth.scenes import Scene
from brrp_cli.prior.build.mesh_files import input_sha256
from brrp_cli.prior.manifest import ObjectEntry
from brrp_cli.prior.names import safe_name

AnyScene = TypeVar("AnyScene", bound=Scene)


def match_names(
    scenes: Sequence[AnyScene], data_root: Path, entries: Sequence[ObjectEntry]
) -> tuple[list[AnyScene], int]:
    """The scenes with their objects called as the prior calls them, and how many meshes it holds.

    A mesh file is the stored object that was made of the same bytes, materials and textures, else
    the one of its name; any other keeps its name. entries : the prior's objects
    """
    by_content: dict[str, list[str]] = {}
    for entry in entries:
        by_content.setdefault(entry.input_sha256, []).append(entry.name)
    stored = {entry.name for entry in entries}
    names: dict[str, str] = {}
    for item in (o for scene in scenes for o in scene.objects):
        if item.mesh_path not in names:
            alike = by_content.get(_sha256(data_root / item.mesh_path), [])
            # Of two stored objects of one content, the one that is called so.
            usual = safe_name(item.name)
            by_name = usual if usual in stored else item.name
            names[item.mesh_path] = alike[0] if alike and usual not in alike else by_name
    matched = [
        replace(
            scene, objects=tuple(replace(o, known_as=names[o.mesh_path]) for o in scene.objects)
        )
        for scene in scenes
    ]
    return matched, len({path for path, name in names.items() if name in stored})


def _sha256(path: Path) -> str:
    """Empty where the file cannot be read, which closing the mesh will tell."""
    try:
        return input_sha256(path)
    except (OSError, ValueError, MeshError):
        return ""
