"""Shapes whose insides are known, and meshes with every fault that people's meshes have."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray


def triangles(vertices: NDArray, faces: NDArray) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False)


def box() -> trimesh.Trimesh:
    return trimesh.creation.box((0.10, 0.06, 0.04))


def moved_box(*shift: float) -> trimesh.Trimesh:
    mesh = box()
    mesh.apply_translation(shift)
    return mesh


def thin_bowl() -> trimesh.Trimesh:
    """Closed, 8 cm in radius, with a wall of 2 mm and an open top (z up)."""
    angle = np.linspace(-np.pi / 2, 0, 16)
    outer = np.stack([0.08 * np.cos(angle), 0.08 * np.sin(angle)], axis=1)
    profile = np.concatenate([outer, outer[::-1] * (0.078 / 0.08)])
    profile[np.abs(profile[:, 0]) < 1e-9, 0] = 0.0
    return trimesh.creation.revolve(profile, sections=48)


def mug() -> trimesh.Trimesh:
    """Closed: a cup with a 4 mm wall and a handle, which is a body of its own that overlaps."""
    profile = np.array([(0, 0), (0.04, 0), (0.04, 0.09), (0.036, 0.09), (0.036, 0.004), (0, 0.004)])
    cup = trimesh.creation.revolve(profile, sections=48)
    handle = trimesh.creation.torus(0.025, 0.005, major_sections=32, minor_sections=12)
    handle.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    handle.apply_translation((0.048, 0, 0.045))
    # The handle reaches into the cup's hollow; keep it to the wall's outside.
    keep = trimesh.creation.box((0.06, 0.06, 0.09))
    keep.apply_translation((0.038 + 0.03, 0, 0.045))
    return trimesh.util.concatenate(
        [cup, trimesh.boolean.intersection([handle, keep], engine="manifold")]
    )


def bowl_sheet() -> trimesh.Trimesh:
    """A half sphere without thickness, 8 cm in radius, open at z = 0."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.08)
    mesh.update_faces(mesh.triangles_center[:, 2] < 0)
    mesh.remove_unreferenced_vertices()
    return mesh


def ball_with_small_hole() -> trimesh.Trimesh:
    """A ball, 5 cm in radius, without the faces around its top."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    mesh.update_faces(np.linalg.norm(mesh.triangles_center - [0, 0, 0.05], axis=1) > 0.006)
    mesh.remove_unreferenced_vertices()
    return mesh


def winding_number(mesh: trimesh.Trimesh, points: NDArray) -> NDArray[np.float64]:
    """Generalised winding number (n,): solid angles of all triangles over 4 pi (Van Oosterom and
    Strackee 1983; Jacobson et al. 2013). Exact, slow, and nothing of the builder's is in it."""
    total = np.zeros(len(points))
    for triangle in np.asarray(mesh.triangles):
        a, b, c = (corner - points for corner in triangle)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        determinant = np.einsum("ij,ij->i", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a)))
        total += 2 * np.arctan2(determinant, la * lb * lc + ab * lc + bc * la + ca * lb)
    return total / (4 * np.pi)
