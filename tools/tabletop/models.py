"""Meshes as physics and camera need them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import MeshError

SUFFIXES = {".obj", ".ply", ".stl", ".off", ".glb"}
MAX_VERTICES = 131_072  # of one shape in PyBullet
TEXTURE_SIZE = 1024
COLUMNS, SQUARE = 512, 8  # of plain colours in the texture of a mesh; pixels of each
DENSITY = 400.0  # kg/m3; between an empty box and a full can


@dataclass(frozen=True)
class Model:
    """One mesh, in its file's coordinates, metres.

    vertices, normals (n, 3), faces (m, 3), uv (n, 2) or None; texture: a PIL image or None.
    hull (h, 3): vertices of the convex hull, relative to `center`, the hull's centroid (3,).
    mass: kg.
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64] | None
    texture: Any
    hull: NDArray[np.float64]
    center: NDArray[np.float64]
    mass: float


def find_meshes(folder: Path, only: Sequence[str] = (), skip: Sequence[str] = ()) -> list[Path]:
    """Meshes of a folder by name: NAME/google_16k/textured.obj, or NAME.obj (.ply, .stl, ...).

    only, skip : prefixes of NAME ("031", "065-d"); a prefix ends where NAME's number ends

    Errors: MeshError if nothing is left.
    """
    found = {
        path.parent.parent.name: path for path in folder.glob("*/google_16k/textured.obj")
    } or {path.stem: path for path in folder.glob("*") if path.suffix.lower() in SUFFIXES}
    chosen = [
        found[name]
        for name in sorted(found)
        if (not only or _begins(name, only)) and not _begins(name, skip)
    ]
    if not chosen:
        raise MeshError(
            "No mesh to make scenes of",
            where=folder,
            expected="NAME/google_16k/textured.obj or NAME.obj, not left out by --only and --skip",
            found=f"{len(found)} meshes before --only and --skip",
        )
    return chosen


def _begins(name: str, prefixes: Sequence[str]) -> bool:
    return any(name == prefix or name.startswith(prefix + "_") for prefix in prefixes)


@lru_cache(maxsize=64)
def load_model(path: Path) -> Model:
    """Read a mesh and prepare it. Errors: MeshError if it cannot be dropped and drawn."""
    import trimesh

    try:
        mesh: Any = trimesh.load(path, force="mesh", process=False)
        hull = mesh.convex_hull
        hull_vertices = np.array(hull.vertices)
        center, volume = np.array(hull.center_mass), float(hull.volume)
    except Exception as error:  # trimesh's readers and qhull raise whatever they like
        raise MeshError("A mesh does not load as a solid", where=path, found=error) from error
    if len(mesh.vertices) > MAX_VERTICES:
        raise MeshError(
            "A mesh is too fine to be drawn",
            where=path,
            expected=f"{MAX_VERTICES} vertices at most",
            found=len(mesh.vertices),
            fix="decimate it",
        )
    uv, texture = _texture(mesh)
    if uv is None and (painted := _plain_colours(path)) is not None:
        mesh, uv, texture = painted
    return Model(
        vertices=np.array(mesh.vertices, dtype=np.float64),
        normals=np.array(mesh.vertex_normals, dtype=np.float64),
        faces=np.array(mesh.faces, dtype=np.int64),
        uv=uv,
        texture=texture,
        hull=hull_vertices - center,
        center=center,
        mass=float(np.clip(DENSITY * volume, 0.02, 1.0)),
    )


def _texture(mesh: Any) -> tuple[NDArray[np.float64] | None, Any]:
    from PIL import Image

    uv = getattr(mesh.visual, "uv", None)
    material = getattr(mesh.visual, "material", None)
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if uv is None or image is None:
        return None, None
    # 4096 x 4096, as YCB has it, shows nothing more at 640 x 480 and costs 64 MB an object.
    side = min(TEXTURE_SIZE, max(image.size))
    return np.array(uv, dtype=np.float64), image.convert("RGB").resize(
        (side, side), Image.Resampling.BOX
    )


def _plain_colours(path: Path) -> tuple[Any, NDArray[np.float64], Any] | None:
    """The mesh with corners of their own for each face, their uv, and a texture with a square for
    each colour, of a file whose faces or vertices have colours; None for a file without."""
    import trimesh
    from PIL import Image

    from brrp_cli.prior.build.coloured_mesh import load_painted

    parts = load_painted(path).parts
    if any(paint.corners is None for _, paint in parts):
        return None
    colours = np.concatenate([paint.corners.mean(axis=1) for _, paint in parts])
    palette, which = np.unique(np.rint(colours).astype(np.uint8), axis=0, return_inverse=True)
    corners = np.concatenate([part.triangles.reshape(-1, 3) for part, _ in parts])
    if len(corners) > MAX_VERTICES:
        return None
    normals = np.concatenate([part.vertex_normals[part.faces].reshape(-1, 3) for part, _ in parts])
    mesh = trimesh.Trimesh(
        corners, np.arange(len(corners)).reshape(-1, 3), vertex_normals=normals, process=False
    )
    columns = min(len(palette), COLUMNS)
    rows = -(-len(palette) // columns)
    squares = np.zeros((rows * columns, 3), dtype=np.uint8)
    squares[: len(palette)] = palette
    squares = squares.reshape(rows, columns, 3).repeat(SQUARE, axis=0).repeat(SQUARE, axis=1)
    row, column = np.divmod(which.ravel(), columns)
    # v = 0 is the lower edge of a texture.
    uv = np.stack([(column + 0.5) / columns, 1 - (row + 0.5) / rows], axis=1)
    return mesh, uv.repeat(3, axis=0), Image.fromarray(squares)
