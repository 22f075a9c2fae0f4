"""The colours of a mesh that is coarser than the texture that it takes them from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library, import_open3d
from brrp_cli.prior.build.coloured_mesh import PaintedMesh
from brrp_cli.prior.parameters import ColoursConfig
from brrp_cli.raycast import raycasting_scene

if TYPE_CHECKING:
    from scipy.sparse import csr_array

GREY = 150


def vertex_colours(
    painted: PaintedMesh,
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    config: ColoursConfig,
) -> NDArray[np.uint8]:
    """RGB (n, 3) of vertices (n, 3), in the frame of a coloured mesh, that show it best when they
    are blended over faces (m, 3).

    A letter that is finer than the faces would leave one vertex black and the next one white. So
    colours are fitted, by least squares, to those of many places on each face. Where there is no
    texture, colours are blended over faces as it is, and a vertex has that of its own place.
    """
    if all(paint.image is None for _, paint in painted.parts):
        return colours_at(painted, vertices)
    corners = vertices[faces]
    within = places_within(config.cuts)
    seen = colours_at(painted, np.einsum("kc,fcj->fkj", within, corners).reshape(-1, 3))
    double_areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    blend = _blending(within, faces, len(vertices))
    share = (blend * np.repeat(double_areas, len(within))[:, None]).T.tocsr()
    # Jacobi's iterations: rows of `blend` sum to 1, so that steps by these weights converge.
    weight = share.sum(axis=1)[:, None]
    found = np.zeros((len(vertices), 3))
    alone = np.flatnonzero(weight == 0)
    if len(alone):
        found[alone] = colours_at(painted, vertices[alone])
    for _ in range(config.steps):
        found += (share @ (seen - blend @ found)) / np.where(weight > 0, weight, 1.0)
    return np.asarray(found.round().clip(0, 255), np.uint8)


def places_within(cuts: int) -> NDArray[np.float64]:
    """Barycentric weights (cuts ** 2, 3) of places spread evenly over a triangle: the middles of
    the triangles that it falls into where each edge is cut into `cuts`."""
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(cuts) for j in range(cuts - i)]
    turned = [(i + 2 / 3, j + 2 / 3) for i in range(cuts) for j in range(cuts - i - 1)]
    first = np.array(upright + turned) / cuts
    return np.column_stack([1 - first.sum(axis=1), first])


def _blending(
    within: NDArray[np.float64], faces: NDArray[np.integer], count: int
) -> csr_array[np.float64]:
    """(m * k, n) shares of `count` vertices at the places `within` (k, 3) each of faces (m, 3)."""
    sparse = import_library("scipy.sparse")
    rows = len(faces) * len(within)
    shares = np.tile(within, (len(faces), 1)).ravel()
    columns = np.repeat(faces, len(within), axis=0).ravel()
    return sparse.csr_array((shares, columns, np.arange(rows + 1) * 3), shape=(rows, count))


def colours_at(painted: PaintedMesh, points: NDArray[np.floating]) -> NDArray[np.uint8]:
    """RGB (n, 3) at the nearest points of a coloured mesh to points (n, 3) in its frame; grey where
    it has no colour."""
    o3d = import_open3d()
    parts = [part.copy() for part, _ in painted.parts]
    # Rays and distances are float32: far from the origin they lose the shape.
    center = painted.vertices.mean(axis=0)
    for part in parts:
        part.apply_translation(-center)
    query = o3d.core.Tensor(np.ascontiguousarray(points - center, dtype=np.float32))
    found = raycasting_scene(parts).compute_closest_points(query)
    part_of = found["geometry_ids"].numpy().astype(np.int64)
    face = found["primitive_ids"].numpy().astype(np.int64)
    uv = found["primitive_uvs"].numpy()
    weights = np.column_stack([1 - uv.sum(axis=1), uv])
    rgb = np.full((len(points), 3), np.nan, np.float32)
    for index, (_, paint) in enumerate(painted.parts):
        here = part_of == index
        rgb[here] = paint.at(face[here], weights[here])
    return np.nan_to_num(rgb, nan=GREY).round().clip(0, 255).astype(np.uint8)
