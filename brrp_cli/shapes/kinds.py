"""Kinds of household objects, each a function of its real dimensions.

Every mesh is closed and outward, in metres, z up, resting on z = 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.shapes import solids

if TYPE_CHECKING:
    import trimesh

SMOOTH = 24  # points on a curved profile or centreline


def bottle(
    radius: float, height: float, neck_radius: float, neck_height: float, shoulder: float
) -> trimesh.Trimesh:
    """A body, a rounded shoulder `shoulder` high, and a neck up to `height`."""
    angle = np.linspace(0, np.pi / 2, SMOOTH)
    below = height - neck_height - shoulder
    curve = np.column_stack(
        [
            neck_radius + (radius - neck_radius) * np.cos(angle),
            below + shoulder * np.sin(angle),
        ]
    )
    profile = [(0, 0), (radius, 0), *map(tuple, curve), (neck_radius, height), (0, height)]
    return solids.revolve(profile)


def mug(radius: float, height: float, thickness: float, handle: float) -> trimesh.Trimesh:
    """A straight cup with a round handle that stands out by `handle` along x."""
    cup = solids.beaker(radius, radius, height, thickness)
    bar = 0.45 * thickness + 0.003
    reach, rise = handle - bar, 0.32 * height
    angle = np.linspace(-np.pi / 2, np.pi / 2, SMOOTH)
    # Straight ends reach into the wall, so that the handle and the cup overlap.
    inside = radius - thickness / 2
    line = np.column_stack([radius + reach * np.cos(angle), height / 2 + rise * np.sin(angle)])
    line = np.vstack([[inside, height / 2 - rise], line, [inside, height / 2 + rise]])
    grip = solids.tube(line, np.full(len(line), bar))
    hollow = solids.moved(solids.cylinder(radius - thickness, height), z=thickness)
    return solids.difference(solids.union(cup, grip), hollow)


def plate(radius: float, height: float, thickness: float, flat: float) -> trimesh.Trimesh:
    """A flat disc of radius `flat` with a rim that slopes up to `radius` at `height`."""
    return solids.revolve(
        [
            (0, 0),
            (flat, 0),
            (radius, height - thickness),
            (radius, height),
            (flat, thickness),
            (0, thickness),
        ]
    )


def screwdriver(length: float, handle: float, grip_radius: float) -> trimesh.Trimesh:
    """Lying along x: a thick grip of length `handle`, then a shaft a fifth as thick."""
    shaft = 0.2 * grip_radius
    return solids.laid_down(
        solids.revolve(
            [
                (0, 0),
                (0.7 * grip_radius, 0),
                (grip_radius, 0.15 * handle),
                (grip_radius, 0.75 * handle),
                (0.6 * grip_radius, 0.9 * handle),
                (0.8 * grip_radius, handle),
                (shaft, handle),
                (shaft, length),
                (0, length),
            ]
        )
    )


def hammer(length: float, head: float, grip_radius: float) -> trimesh.Trimesh:
    """Lying flat: a handle along x and, across its end, a head `head` long."""
    side = 2.2 * grip_radius
    handle = solids.laid_down(solids.cylinder(grip_radius, length - side / 2))
    block = solids.moved(solids.box(side, head, side), x=(length - side / 2) / 2)
    lifted = solids.moved(handle, z=side / 2 - grip_radius)
    return solids.union(lifted, block)


def banana(length: float, radius: float) -> trimesh.Trimesh:
    """Lying on its side, bent through 100 degrees, thin at both ends."""
    angle = np.linspace(-1, 1, SMOOTH) * np.deg2rad(50)
    bend = (length / 2) / np.sin(angle[-1])
    line = np.column_stack([bend * np.sin(angle), bend * (np.cos(angle) - 1)])
    radii = radius * (0.25 + 0.75 * np.cos(np.linspace(-1, 1, SMOOTH) * np.pi / 2) ** 0.6)
    mesh = solids.tube(line, radii)
    # The bend was drawn in the x-z plane; on a table it lies in the x-y plane.
    mesh.vertices = mesh.vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    (_, y0, z0), (_, y1, _) = mesh.bounds
    return solids.moved(mesh, y=-(y0 + y1) / 2, z=-z0)


def spray_bottle(radius: float, height: float, depth_ratio: float) -> trimesh.Trimesh:
    """An elliptical bottle with a pistol-shaped head whose nozzle points along x."""
    head = 0.12 * height
    body = bottle(radius, height - head / 2, 0.35 * radius, 0.12 * height, 0.28 * height)
    body = solids.squeezed(body, depth_ratio)
    pistol = solids.moved(solids.box(1.6 * radius, 0.6 * radius, head), x=0.3 * radius)
    trigger = solids.moved(solids.box(0.2 * radius, 0.3 * radius, head), x=0.8 * radius)
    top = height - head
    return solids.union(
        body, solids.moved(pistol, z=top), solids.moved(trigger, z=top - 0.8 * head)
    )


def apple(radius: float) -> trimesh.Trimesh:
    """A ball with a dimple at the stalk: r = radius (1 - dimple), deepest on the axis."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 2 * SMOOTH)
    distance = radius * (1 - 0.25 * np.exp(-(((np.pi / 2 - angle) / 0.45) ** 2)))
    profile = np.column_stack([distance * np.cos(angle), distance * np.sin(angle)])
    profile[[0, -1], 0] = 0.0
    profile[:, 1] -= profile[:, 1].min()
    return solids.revolve(profile)
