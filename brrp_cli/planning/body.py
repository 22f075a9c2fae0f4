"""One object as simulators and planners know it: a rigid body in coordinates of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import normalise, similarity

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """A rigid body; everything but its pose is in its own coordinates, metres.

    Its origin is its centre of mass, z points away from the table, x is the image's right.

    name : as in the files; T_frame_body : (4, 4) rigid, to the frame of the results
    mesh : the best guess, closed; collision : closed, what `parts` are made of: the same mesh or
    the one inside which the object lies with some probability
    parts : corners (k, 3) of convex parts
    mass : kg; inertia : (3, 3) kg m^2 about the origin, both of `mesh` at one density
    colour : (3,) RGB, 0 to 1
    """

    name: str
    T_frame_body: Array
    mesh: trimesh.Trimesh
    collision: trimesh.Trimesh
    parts: list[Array]
    mass: float
    inertia: Array
    colour: Array


def body_axes(up: NDArray[np.floating], ahead: NDArray[np.floating]) -> Array:
    """(3, 3) columns x, y, z: z along `up` (3,), x as close to `ahead` (3,) as that leaves it."""
    z = normalise(up)
    x = ahead - (ahead @ z) * z
    if np.linalg.norm(x) < 1e-6:
        x = np.cross(z, [0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [0.0, 1.0, 0.0])
    x = normalise(x)
    return np.column_stack([x, np.cross(z, x), z])


def body_pose(mesh: trimesh.Trimesh, axes: Array) -> Array:
    """T_frame_body (4, 4) of a closed mesh: its centre of mass, and `axes` (3, 3) as columns."""
    return similarity(1.0, axes, np.asarray(mesh.center_mass))


def mass_and_inertia(mesh: trimesh.Trimesh, density: float) -> tuple[float, Array]:
    """Mass, kg, and inertia (3, 3), kg m^2, about the centre of mass of a solid, closed mesh.

    density : kg / m^3
    """
    solid = mesh.copy()
    solid.density = density
    inertia = np.asarray(solid.moment_inertia, dtype=np.float64)
    return float(solid.mass), (inertia + inertia.T) / 2


def lift_onto(body: Body, up: NDArray[np.floating], offset: float) -> float:
    """Metres that the body has to go up for no part of it to lie below the plane
    up . x + offset = 0; 0 where none does."""
    corners = np.vstack(body.parts) @ body.T_frame_body[:3, :3].T + body.T_frame_body[:3, 3]
    return max(0.0, -float((corners @ up + offset).min()))
