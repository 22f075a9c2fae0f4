"""Solids from which household shapes are made.

Each function gives a closed, outward trimesh in metres, standing on z = 0 with z up and centred on
the z axis unless it says otherwise. Circles are polygons of `SECTIONS` corners with the asked
radius at the corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import trimesh

SECTIONS = 64  # a multiple of 4, so that the extents along x and y are the asked diameters

Profile = Sequence[tuple[float, float]] | NDArray[np.float64]


def revolve(profile: Profile) -> trimesh.Trimesh:
    """Turn `profile`, (n, 2) pairs of radius and height, about the z axis.

    The profile goes from the axis at the bottom, along the outside, to the axis again: for a
    vessel, up the outer wall, over the rim and down the inner wall.
    """
    import trimesh

    return trimesh.creation.revolve(np.asarray(profile, dtype=np.float64), sections=SECTIONS)


def box(width: float, depth: float, height: float) -> trimesh.Trimesh:
    """Extents along x, y and z."""
    import trimesh

    mesh = trimesh.creation.box((width, depth, height))
    mesh.apply_translation((0, 0, height / 2))
    return mesh


def cylinder(radius: float, height: float) -> trimesh.Trimesh:
    """A can."""
    return revolve([(0, 0), (radius, 0), (radius, height), (0, height)])


def ball(radius: float) -> trimesh.Trimesh:
    """A sphere, by revolution of half a circle."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, SECTIONS // 2 + 1)
    profile = np.column_stack([radius * np.cos(angle), radius * (1 + np.sin(angle))])
    profile[[0, -1], 0] = 0.0
    return revolve(profile)


def beaker(
    bottom_radius: float, top_radius: float, height: float, thickness: float
) -> trimesh.Trimesh:
    """An open cup: walls `thickness` across (measured horizontally), a floor `thickness` high."""
    slope = (top_radius - bottom_radius) / height
    floor_radius = bottom_radius + slope * thickness - thickness
    return revolve(
        [
            (0, 0),
            (bottom_radius, 0),
            (top_radius, height),
            (top_radius - thickness, height),
            (floor_radius, thickness),
            (0, thickness),
        ]
    )


def spherical_bowl(
    base_radius: float, rim_radius: float, height: float, thickness: float
) -> trimesh.Trimesh:
    """A bowl between two concentric spheres, cut flat at base, floor and rim."""
    middle, radius = bowl_sphere(base_radius, rim_radius, height)
    outer = _arc(radius, middle, 0.0, height)
    inner = _arc(radius - thickness, middle, thickness, height)[::-1]
    return revolve([(0, 0), *map(tuple, outer), *map(tuple, inner), (0, thickness)])


def bowl_sphere(base_radius: float, rim_radius: float, height: float) -> tuple[float, float]:
    """Height of the centre and radius of the sphere through a bowl's base and rim circles."""
    middle = (rim_radius**2 + height**2 - base_radius**2) / (2 * height)
    return middle, float(np.hypot(base_radius, middle))


def tube(centreline: Profile, radii: Sequence[float] | NDArray[np.float64]) -> trimesh.Trimesh:
    """A tube along `centreline`, (n, 2) points in the x-z plane, with a radius at each; flat ends.

    It lies where the centreline lies. The centreline must not bend tighter than the radius.
    """
    import trimesh

    line = np.asarray(centreline, dtype=np.float64)
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.column_stack([-along[:, 1], np.zeros(len(line)), along[:, 0]])
    angle = np.arange(SECTIONS) * 2 * np.pi / SECTIONS
    ring = np.cos(angle)[:, None] * across[:, None, :] - np.sin(angle)[:, None] * [0.0, 1.0, 0.0]
    centres = np.insert(line, 1, 0.0, axis=1)
    vertices = centres[:, None, :] + np.asarray(radii)[:, None, None] * ring
    vertices = np.concatenate([vertices.reshape(-1, 3), centres[[0, -1]]])

    here = np.arange(SECTIONS)
    following = (here + 1) % SECTIONS
    first, last = np.full(SECTIONS, len(vertices) - 2), np.full(SECTIONS, len(vertices) - 1)
    end = (len(line) - 1) * SECTIONS
    faces = [np.column_stack([following, here, first])]
    for start in range(0, end, SECTIONS):
        a, b = here + start, following + start
        faces += [np.column_stack([a, b, b + SECTIONS])]
        faces += [np.column_stack([a, b + SECTIONS, a + SECTIONS])]
    faces += [np.column_stack([here + end, following + end, last])]
    return trimesh.Trimesh(vertices, np.concatenate(faces), process=False)


def moved(mesh: trimesh.Trimesh, x: float = 0, y: float = 0, z: float = 0) -> trimesh.Trimesh:
    """A shifted copy."""
    copy = mesh.copy()
    copy.apply_translation((x, y, z))
    return copy


def laid_down(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A copy whose z axis lies along x, resting on z = 0 and centred on the z axis."""
    import trimesh

    copy = mesh.copy()
    copy.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    (x0, y0, z0), (x1, y1, _) = copy.bounds
    copy.apply_translation((-(x0 + x1) / 2, -(y0 + y1) / 2, -z0))
    return copy


def squeezed(mesh: trimesh.Trimesh, factor: float) -> trimesh.Trimesh:
    """A copy scaled by `factor` along y: elliptical bottles."""
    copy = mesh.copy()
    copy.apply_scale((1.0, factor, 1.0))
    return copy


def union(*meshes: trimesh.Trimesh) -> trimesh.Trimesh:
    """Exact union; overlapping parts become one closed surface."""
    import trimesh

    return trimesh.boolean.union(meshes, engine="manifold")


def difference(mesh: trimesh.Trimesh, *others: trimesh.Trimesh) -> trimesh.Trimesh:
    """`mesh` without what lies in `others`, exactly."""
    import trimesh

    return trimesh.boolean.difference((mesh, *others), engine="manifold")


def _arc(radius: float, middle: float, low: float, high: float) -> NDArray[np.float64]:
    start, stop = np.arcsin((np.array([low, high]) - middle) / radius)
    angle = np.linspace(start, stop, SECTIONS // 4 + 1)
    arc = np.column_stack([radius * np.cos(angle), middle + radius * np.sin(angle)])
    arc[[0, -1], 1] = low, high
    return arc
