"""Solids from closed surfaces: which bodies are matter, which are cavities, and their union."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import trimesh


def is_solid(mesh: trimesh.Trimesh) -> bool:
    """Closed, wound alike, facing outward: every edge has two faces, and manifold3d agrees."""
    import manifold3d

    if not (mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0):
        return False
    return bool(_manifold(mesh).status() == manifold3d.Error.NoError)


def is_flat(body: trimesh.Trimesh) -> bool:
    """Whether a closed body encloses nothing, such as a sheet that lies back to back."""
    # Of no volume trimesh divides by it, for the centre of mass.
    with np.errstate(divide="ignore", invalid="ignore"):
        return bool(abs(body.volume) <= 1e-9 * body.area**1.5)


def unite_bodies(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, list[str]]:
    """Turn every body of a closed mesh the right way and unite those that overlap.

    A body that faces inward is a cavity where it lies inside of another body, and wrong otherwise.
    Without the union, a point in two bodies would count as outside for ray parity. Returns the
    mesh and what was done, in words; nothing done returns the mesh itself.
    """
    import manifold3d

    bodies = list(mesh.split(only_watertight=False))
    parts = [body for body in bodies if not is_flat(body)]
    if len(bodies) == 1 or not parts:
        if mesh.volume < 0:
            mesh = mesh.copy()
            mesh.invert()
            return mesh, ["turned the surface outward"]
        return mesh, []
    outward = [part for part in parts if part.volume > 0]
    inward = [part for part in parts if part.volume <= 0]
    cavities = []
    turned = 0
    for part in inward:
        part.invert()
        if any(_holds(body, part) for body in parts if body is not part and _larger(body, part)):
            cavities.append(part)
        else:
            outward.append(part)
            turned += 1
    solid = manifold3d.Manifold.batch_boolean(
        [_manifold(part) for part in outward], manifold3d.OpType.Add
    )
    separate = sum(part.volume for part in outward)
    overlap = separate - solid.volume()
    flat = len(bodies) - len(parts)
    if not turned and not flat and overlap <= 1e-9 * separate:
        return mesh, []
    for part in cavities:
        solid -= _manifold(part)
    steps = [f"dropped {flat} bodies without volume"] if flat else []
    if turned:
        steps.append(f"turned {turned} bodies outward")
    if overlap > 1e-9 * separate:
        steps.append(f"united {len(outward)} overlapping bodies")
    return _trimesh(solid), steps


def _larger(body: trimesh.Trimesh, part: trimesh.Trimesh) -> bool:
    return bool(abs(body.volume) > abs(part.volume))


def _holds(body: trimesh.Trimesh, part: trimesh.Trimesh) -> bool:
    from brrp_cli.prior.build.samples import inside

    return bool(inside(body, np.asarray(part.vertices)).mean() > 0.5)


def _manifold(mesh: trimesh.Trimesh):  # type: ignore[no-untyped-def]
    import manifold3d

    return manifold3d.Manifold(
        manifold3d.Mesh64(
            np.array(mesh.vertices, dtype=np.float64, order="C"),
            np.array(mesh.faces, dtype=np.uint64, order="C"),
        )
    )


def _trimesh(solid) -> trimesh.Trimesh:  # type: ignore[no-untyped-def]
    import trimesh

    mesh = solid.to_mesh64()
    return trimesh.Trimesh(
        np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts), process=False
    )
