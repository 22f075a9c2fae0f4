"""What an object is made from: its mesh file, and the materials and textures that it names."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from brrp_cli.errors import MeshError
from brrp_cli.files import sha256_file

_OBJ_MATERIALS = re.compile(rb"^\s*mtllib[ \t]+(.+?)\s*$", re.MULTILINE)
_MTL_TEXTURES = re.compile(rb"^\s*map_\w+[ \t]+(.+?)\s*$", re.MULTILINE)
_PLY_TEXTURES = re.compile(rb"^comment TextureFile[ \t]+(.+?)\s*$", re.MULTILINE)
_PLY_HEADER = 2**16


def input_sha256(path: Path) -> str:
    """sha256 of a mesh file; where it names materials or textures, of the sums of all of them.

    Errors: OSError; MeshError where the path is no file, such as a pipe that would never end.
    """
    if path.exists() and not path.is_file():
        raise MeshError("The mesh is no file", where=path)
    own = sha256_file(path)
    others = _named_files(path)
    if not others:
        return own
    return hashlib.sha256("\n".join([own, *map(_sum, others)]).encode()).hexdigest()


def _named_files(path: Path) -> list[Path]:
    """Files that a mesh names, in its order, whether they are there or not."""
    suffix = path.suffix.lower()
    if suffix == ".ply":
        with path.open("rb") as stream:
            return _beside(path, _PLY_TEXTURES.findall(stream.read(_PLY_HEADER)))
    if suffix != ".obj":
        return []
    materials = _beside(path, _OBJ_MATERIALS.findall(path.read_bytes()))
    textures = [
        texture
        for material in materials
        if material.is_file()
        for texture in _beside(material, _MTL_TEXTURES.findall(material.read_bytes()))
    ]
    return list(dict.fromkeys([*materials, *textures]))


def _beside(path: Path, names: list[bytes]) -> list[Path]:
    return [path.parent / name.decode(errors="replace").replace("\0", "") for name in names]


def _sum(path: Path) -> str:
    """One that comes or goes later changes the whole."""
    return sha256_file(path) if path.is_file() else "missing"
