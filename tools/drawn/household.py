"""Household shapes of random dimensions: as many objects as a training asks for."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.shapes import kinds, solids

if TYPE_CHECKING:
    import trimesh

Draw = Callable[[np.random.Generator], "trimesh.Trimesh"]


def draw_household_shape(rng: np.random.Generator) -> tuple[str, trimesh.Trimesh]:
    """A kind, each as probable as any other, and a closed, outward mesh of it in metres, standing
    on z = 0 or lying there; no dimension lies outside of what fits a hand and a table."""
    kind = str(rng.choice(sorted(KINDS)))
    return kind, KINDS[kind](rng)


def _box(rng: np.random.Generator) -> trimesh.Trimesh:
    return solids.box(*rng.uniform((0.03, 0.02, 0.03), (0.16, 0.12, 0.24)))


def _can(rng: np.random.Generator) -> trimesh.Trimesh:
    return solids.cylinder(*rng.uniform((0.02, 0.03), (0.06, 0.18)))


def _ball(rng: np.random.Generator) -> trimesh.Trimesh:
    return solids.ball(rng.uniform(0.018, 0.06))


def _bottle(rng: np.random.Generator) -> trimesh.Trimesh:
    radius, height = rng.uniform(0.025, 0.05), rng.uniform(0.14, 0.26)
    neck, rise, shoulder = rng.uniform((0.3, 0.1, 0.15), (0.5, 0.2, 0.3))
    body = kinds.bottle(radius, height, neck * radius, rise * height, shoulder * height)
    return solids.squeezed(body, rng.uniform(0.6, 1.0))


def _spray_bottle(rng: np.random.Generator) -> trimesh.Trimesh:
    return kinds.spray_bottle(*rng.uniform((0.035, 0.2, 0.6), (0.05, 0.27, 0.9)))


def _mug(rng: np.random.Generator) -> trimesh.Trimesh:
    radius, height, thickness = rng.uniform((0.032, 0.07, 0.004), (0.052, 0.12, 0.007))
    return kinds.mug(radius, height, thickness, rng.uniform(0.028, 0.04))


def _cup(rng: np.random.Generator) -> trimesh.Trimesh:
    bottom, wider, height = rng.uniform((0.022, 1.05, 0.06), (0.036, 1.5, 0.13))
    return solids.beaker(bottom, wider * bottom, height, rng.uniform(0.003, 0.005))


def _bowl(rng: np.random.Generator) -> trimesh.Trimesh:
    base, wider, height = rng.uniform((0.025, 1.7, 0.04), (0.04, 2.4, 0.075))
    return solids.spherical_bowl(base, wider * base, height, rng.uniform(0.004, 0.007))


def _plate(rng: np.random.Generator) -> trimesh.Trimesh:
    radius, height, thickness, flat = rng.uniform(
        (0.07, 0.014, 0.004, 0.5), (0.13, 0.03, 0.007, 0.75)
    )
    return kinds.plate(radius, height, thickness, flat * radius)


def _apple(rng: np.random.Generator) -> trimesh.Trimesh:
    return kinds.apple(rng.uniform(0.025, 0.05))


def _banana(rng: np.random.Generator) -> trimesh.Trimesh:
    return kinds.banana(*rng.uniform((0.12, 0.012), (0.21, 0.022)))


def _screwdriver(rng: np.random.Generator) -> trimesh.Trimesh:
    length, grip = rng.uniform((0.12, 0.010), (0.27, 0.018))
    return kinds.screwdriver(length, rng.uniform(0.35, 0.6) * length, grip)


def _hammer(rng: np.random.Generator) -> trimesh.Trimesh:
    return kinds.hammer(*rng.uniform((0.2, 0.08, 0.01), (0.33, 0.14, 0.017)))


KINDS: dict[str, Draw] = {
    "apple": _apple,
    "ball": _ball,
    "banana": _banana,
    "bottle": _bottle,
    "bowl": _bowl,
    "box": _box,
    "can": _can,
    "cup": _cup,
    "hammer": _hammer,
    "mug": _mug,
    "plate": _plate,
    "screwdriver": _screwdriver,
    "spray_bottle": _spray_bottle,
}
