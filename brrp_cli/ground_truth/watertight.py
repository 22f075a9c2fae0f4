"""The true mesh as the published tables close it.

The tables' true meshes were made watertight with the method of Huang, Su & Guibas (2018,
arXiv 1802.01698), as point-cloud-utils ships it. Its `resolution` is a number of octree leaves on
the surface: the octree is halved until it has at least that many (so that two resolutions may give
the same mesh), and the surface is drawn around the occupied leaves. Every wall therefore grows on
both sides, which closes holes and thickens thin shells: by 2.5 mm a side for a box of 10 x 6 x
20 cm at 4,000. The octree follows the axes of the frame that the vertices are given in, and a
turned mesh is closed differently: close a mesh in its own frame, then pose it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.dependencies import import_library
from brrp_cli.errors import DependencyError
from brrp_cli.files import atomic_path
from brrp_cli.ground_truth.kept import read_kept

if TYPE_CHECKING:
    import trimesh

IOU_RESOLUTION = 4_000
CHAMFER_RESOLUTION = 10_000


def published_truth(
    mesh: trimesh.Trimesh, resolution: int, cache: Path | None = None
) -> trimesh.Trimesh:
    """`mesh`, in its own frame and metres, made watertight at `resolution`.

    cache : a folder that keeps results by the content of the mesh; made if it is missing.
    Errors: DependencyError without point-cloud-utils (`pip install 'brrp-cli[eval]'`); SceneError
    where what was kept is damaged.
    """
    import trimesh

    kept = None if cache is None else cache / f"{content_hash(mesh)}-{resolution}.npz"
    if kept is not None and kept.exists():
        vertices, faces = read_kept(kept, "vertices", "faces")
        return trimesh.Trimesh(vertices, faces, process=False)
    try:
        pcu = import_library("point_cloud_utils")
    except DependencyError as error:
        error.fix = "pip install 'brrp-cli[eval]', which brings point-cloud-utils"
        raise
    vertices, faces = pcu.make_mesh_watertight(
        np.array(mesh.vertices, dtype=np.float64),
        np.array(mesh.faces, dtype=np.int32),
        resolution=resolution,
    )
    if kept is not None:
        with atomic_path(kept) as partial:
            np.savez_compressed(partial, vertices=vertices, faces=faces)
    return trimesh.Trimesh(vertices, faces, process=False)


def content_hash(mesh: trimesh.Trimesh) -> str:
    """What names a mesh by its vertices and faces."""
    digest = hashlib.sha256(np.array(mesh.vertices, dtype="<f8").tobytes())
    digest.update(np.array(mesh.faces, dtype="<i8").tobytes())
    return digest.hexdigest()[:32]
