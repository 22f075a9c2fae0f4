"""Find objects in the folder layouts that people have."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from brrp_cli.errors import MeshError
from brrp_cli.prior.names import safe_name

SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb")

# Layouts in which an object is a folder; the first that fits a folder is taken.
OBJECT_FOLDERS = (
    "google_16k/textured.obj",  # YCB, the official archive
    "google_64k/textured.obj",
    "google_512k/textured.obj",
    "tsdf/textured.obj",
    "poisson/textured.obj",
    "meshes/model.obj",  # Google Scanned Objects
    "models/model_normalized.obj",  # ShapeNet
)


@dataclass(frozen=True)
class MeshSource:
    """One object to be: its name in the prior, its mesh file, and that file relative to the folder
    that was searched."""

    name: str
    path: Path
    relative: str


def find_meshes(folder: Path) -> list[MeshSource]:
    """Objects in `folder`, sorted by name.

    An object is a mesh file in `folder` itself, or a folder in one of `OBJECT_FOLDERS`. Errors:
    MeshError when there is none, or when two would have one name.
    """
    if not folder.is_dir():
        raise MeshError("There is no such folder of meshes", where=folder)
    sources = []
    for entry in sorted(folder.iterdir()):
        if entry.name.startswith("."):
            continue
        if entry.is_dir():
            inner = next((entry / p for p in OBJECT_FOLDERS if (entry / p).is_file()), None)
            if inner is not None:
                relative = inner.relative_to(folder).as_posix()
                sources.append(MeshSource(safe_name(entry.name), inner, relative))
        elif entry.suffix.lower() in SUFFIXES:
            sources.append(MeshSource(safe_name(entry.stem), entry, entry.name))
    if not sources:
        raise MeshError(
            "No meshes found",
            where=folder,
            expected=f"files {' '.join(SUFFIXES)}, or folders NAME/{OBJECT_FOLDERS[0]}",
            found=_what_is_there(folder),
        )
    _refuse_collisions(sources, folder)
    return sorted(sources, key=lambda source: source.name)


def find_all_meshes(places: Sequence[Path]) -> list[MeshSource]:
    """Objects in several places together, sorted by name.

    A place is a folder of meshes (see find_meshes), a mesh file, or the folder of one object, such
    as 025_mug/ of the YCB archive. Errors: those of find_meshes.
    """
    sources = [source for place in places for source in _at(place)]
    _refuse_collisions(sources, " and ".join(map(str, places)))
    return sorted(sources, key=lambda source: source.name)


def _at(place: Path) -> list[MeshSource]:
    if place.is_file() and place.suffix.lower() in SUFFIXES:
        return [MeshSource(safe_name(place.stem), place, place.name)]
    inner = next((p for p in OBJECT_FOLDERS if (place / p).is_file()), None)
    if inner is None:
        return find_meshes(place)
    name = place.resolve().name
    return [MeshSource(safe_name(name), place / inner, f"{name}/{inner}")]


def _what_is_there(folder: Path) -> str:
    names = sorted(entry.name for entry in folder.iterdir())
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return (", ".join(names[:5]) + more) if names else "an empty folder"


def _refuse_collisions(sources: list[MeshSource], where: object) -> None:
    by_name = defaultdict(list)
    for source in sources:
        # Results are files named after objects, also on file systems that ignore case.
        by_name[source.name.casefold()].append(source)
    clashes = [_told(same) for same in by_name.values() if len(same) > 1]
    if clashes:
        raise MeshError(
            "Several meshes would be objects of one name",
            where=where,
            found="; ".join(clashes[:5]),
            fix="rename or move all but one of each",
        )


def _told(same: list[MeshSource]) -> str:
    """Files by their place in the folder; by their whole path where they have the same place."""
    relative = [source.relative for source in same]
    several = len(set(relative)) < len(relative)
    return " and ".join([str(source.path) for source in same] if several else relative)
