"""A mesh file with its colours: textures, vertex colours, plain materials."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import MeshError
from brrp_cli.files import trouble_of
from brrp_cli.prior.parameters import UNITS

if TYPE_CHECKING:
    import trimesh

# Finer textures show nothing more to a camera that is further away than a hand.
TEXTURE_SIZE = 512


@dataclass(frozen=True)
class Paint:
    """The colours of one mesh; at most one of the sources is there.

    corners : (m, 3, 3) float32, RGB 0 to 255 of the corners of each face
    uv : (m, 3, 2) float32, texture coordinates of the corners; image : (h, w, 3) uint8
    """

    corners: NDArray[np.float32] | None = None
    uv: NDArray[np.float32] | None = None
    image: NDArray[np.uint8] | None = None

    def at(self, face: NDArray[np.int64], weights: NDArray[np.float32]) -> NDArray[np.float32]:
        """RGB (k, 3), 0 to 255, at barycentric weights (k, 3) of faces (k,); NaN: no colour."""
        if self.corners is not None:
            return np.einsum("kc,kcj->kj", weights, self.corners[face]).astype(np.float32)
        if self.uv is None or self.image is None:
            return np.full((len(face), 3), np.nan, np.float32)
        uv = np.einsum("kc,kcj->kj", weights, self.uv[face]) % 1.0
        height, width = self.image.shape[:2]
        column = np.minimum((uv[:, 0] * width).astype(np.int64), width - 1)
        row = np.minimum(((1 - uv[:, 1]) * height).astype(np.int64), height - 1)
        return self.image[row, column].astype(np.float32)


@dataclass(frozen=True)
class PaintedMesh:
    """Triangles in metres, mesh frame, each part with its paint."""

    parts: tuple[tuple[trimesh.Trimesh, Paint], ...]

    @property
    def vertices(self) -> NDArray[np.float64]:
        """(n, 3) vertices of all parts."""
        return np.concatenate([np.asarray(mesh.vertices) for mesh, _ in self.parts])


def unpainted(mesh: trimesh.Trimesh) -> PaintedMesh:
    """A mesh, in metres, of whose colours nothing is known."""
    return PaintedMesh(((mesh, Paint()),))


def load_painted(path: Path, units: str = "m") -> PaintedMesh:
    """Read a file with all that it says of colour. Errors: MeshError."""
    import trimesh

    try:
        # Not in the order of the file: a vertex on a seam of the texture has several coordinates
        # there, and would keep one of them.
        scene = trimesh.load_scene(path, process=False)
        parts = [
            (_bare(mesh, T_scene_mesh, units), _paint(mesh))
            for mesh, T_scene_mesh in _placed(scene)
            if len(getattr(mesh, "faces", ()))
        ]
    except Exception as error:  # trimesh's readers raise whatever the file made them stumble over
        raise MeshError(
            "The mesh's colours cannot be read", where=path, found=trouble_of(error)
        ) from error
    return PaintedMesh(tuple(parts))


def _placed(scene: Any) -> Iterator[tuple[Any, NDArray[np.float64]]]:
    """Each mesh of a scene with its T_scene_mesh (4, 4). `scene.dump()` would copy textures."""
    for node in scene.graph.nodes_geometry:
        T_scene_mesh, name = scene.graph[node]
        yield scene.geometry[name], np.asarray(T_scene_mesh, dtype=np.float64)


def _bare(mesh: Any, T_scene_mesh: NDArray[np.float64], units: str) -> trimesh.Trimesh:
    import trimesh

    bare = trimesh.Trimesh(np.asarray(mesh.vertices), mesh.faces, process=False)
    bare.apply_transform(T_scene_mesh)
    bare.apply_scale(UNITS[units])
    return bare


def _paint(mesh: Any) -> Paint:
    visual = mesh.visual
    kind = getattr(visual, "kind", None)
    if kind == "vertex":
        colors = np.asarray(visual.vertex_colors, dtype=np.float32)[:, :3]
        return Paint(corners=colors[mesh.faces])
    if kind == "face":
        colors = np.asarray(visual.face_colors, dtype=np.float32)[:, :3]
        return Paint(corners=np.repeat(colors[:, None], 3, axis=1))
    if kind != "texture":
        return Paint()
    material, uv = visual.material, visual.uv
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if image is not None and uv is not None:
        return Paint(uv=np.asarray(uv, dtype=np.float32)[mesh.faces], image=_small(image))
    plain = np.asarray(material.main_color, dtype=np.float32)[:3]
    return Paint(corners=np.broadcast_to(plain, (len(mesh.faces), 3, 3)))


def _small(image: Any) -> NDArray[np.uint8]:
    from PIL import Image

    size = tuple(min(TEXTURE_SIZE, side) for side in image.size)
    # A JPEG can be decoded at half, a quarter or an eighth of its size, which saves most of the
    # time. It stays twice as fine as what is kept of it.
    image.draft("RGB", tuple(2 * side for side in size))
    plain = image if image.mode == "RGB" else image.convert("RGB")
    return np.asarray(plain.resize(size, Image.Resampling.BOX), dtype=np.uint8)
