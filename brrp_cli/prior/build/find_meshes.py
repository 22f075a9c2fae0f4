"""Find objects in the folder layouts that people have."""

from __future__ import annotations

import logging
import os
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from brrp_cli.errors import MeshError
from brrp_cli.files import exists
from brrp_cli.prior.names import safe_name
from brrp_cli.spoken import few

log = logging.getLogger(__name__)

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
        raise _no_folder(folder)
    sources = []
    for entry in sorted(folder.iterdir()):
        if entry.name.startswith("."):
            continue
        if entry.is_dir():
            inner = _inner(entry)
            if inner is not None:
                sources.append(
                    MeshSource(safe_name(entry.name), entry / inner, f"{entry.name}/{inner}")
                )
        elif entry.suffix.lower() in SUFFIXES:
            sources.append(MeshSource(safe_name(entry.stem), entry, entry.name))
    if not sources:
        raise MeshError(
            "No meshes found",
            where=folder,
            expected=f"files {' '.join(SUFFIXES)}, or folders NAME/{OBJECT_FOLDERS[0]}",
            found=_what_is_there(folder),
            fix=f"name the folder that holds them: {folder / nested[0]}"
            if (nested := _folders_of_meshes(folder))
            else "export the meshes in one of these formats, or name the folder that holds them",
        )
    _refuse_collisions(sources, folder)
    return sorted(sources, key=lambda source: source.name)


def find_all_meshes(places: Sequence[Path]) -> list[MeshSource]:
    """Objects in several places together, sorted by name.

    A place is a folder of meshes (see find_meshes), a mesh file, or the folder of one object, such
    as 025_mug/ of the YCB archive. Errors: those of find_meshes.
    """
    sources = [source for place in places for source in _at(place)]
    for place in places:
        _note_passed_over(place, places)
    _refuse_collisions(sources, " and ".join(map(str, places)))
    return sorted(sources, key=lambda source: source.name)


def _at(place: Path) -> list[MeshSource]:
    if place.is_file() and place.suffix.lower() in SUFFIXES:
        return [MeshSource(safe_name(place.stem), place, place.name)]
    inner = _inner(place)
    if inner is None:
        return find_meshes(place)
    name = place.resolve().name
    return [MeshSource(safe_name(name), place / inner, f"{name}/{inner}")]


def _inner(folder: Path) -> str | None:
    """Where the mesh of an object lies whose folder this is; None for any other folder."""
    return next((p for p in OBJECT_FOLDERS if (folder / p).is_file()), None)


def _no_folder(path: Path) -> MeshError:
    if exists(path):
        return MeshError(
            "The file is no mesh of a known format",
            where=path,
            expected=f"a folder of meshes, or a file {' '.join(SUFFIXES)}",
            found=path.suffix or "a name without an ending",
            fix="export the mesh in one of these formats",
        )
    return MeshError("There is no such folder of meshes", where=path, fix="check the path")


def _folders_of_meshes(folder: Path) -> list[str]:
    """Names of the folders in `folder` that hold meshes, somewhere, but are no object's."""
    return [
        entry.name
        for entry in sorted(folder.iterdir())
        if entry.is_dir()
        and not entry.name.startswith(".")
        and _inner(entry) is None
        and any(name.lower().endswith(SUFFIXES) for _, _, names in os.walk(entry) for name in names)
    ]


def _note_passed_over(place: Path, places: Sequence[Path]) -> None:
    """Meshes deeper in a folder may have been meant, too."""
    if not place.is_dir() or _inner(place) is not None:
        return
    given = [each.resolve() for each in places]
    passed = [
        name
        for name in _folders_of_meshes(place)
        if not any(each.is_relative_to((place / name).resolve()) for each in given)
    ]
    if passed:
        log.warning(
            "%s: meshes in its folders are left out: %s. Name a folder to take its meshes, too",
            place,
            few(passed),
        )


def _what_is_there(folder: Path) -> str:
    names = sorted(entry.name for entry in folder.iterdir())
    return few(names) if names else "an empty folder"


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
