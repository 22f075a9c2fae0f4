"""Convex parts: they hold what they are made of, and keep what is hollow."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from brrp_cli.config.planning import PartsConfig
from brrp_cli.planning.parts import COACD, HULL, beyond_hull, convex_parts, cover, hull_corners
from brrp_cli.planning.union import union_of_hulls
from brrp_cli.shapes import solids


def channel() -> trimesh.Trimesh:
    """A U of three boards, open upwards, 12 x 8 x 8 cm."""
    return solids.difference(
        solids.box(0.12, 0.08, 0.08), solids.moved(solids.box(0.06, 0.1, 0.08), z=0.03)
    )


def of(mesh, how, seed=0):
    return convex_parts(np.asarray(mesh.vertices), np.asarray(mesh.faces), how, seed, PartsConfig())


def test_a_hull_is_one_part_with_the_corners_alone():
    mesh = solids.box(0.1, 0.06, 0.04).subdivide()
    (part,) = of(mesh, HULL)
    assert len(part) == 8
    assert beyond_hull(part, np.asarray(mesh.vertices)).max() < 1e-12


def test_coacd_keeps_the_channel_open():
    pytest.importorskip("coacd")
    mesh = channel()
    parts = of(mesh, COACD)
    assert 3 <= len(parts) <= 5
    assert np.min([beyond_hull(p, np.asarray(mesh.vertices)) for p in parts], 0).max() < 1e-9
    assert min(beyond_hull(p, np.array([[0, 0, 0.06]]))[0] for p in parts) > 0.02
    again = of(mesh, COACD)
    assert all(np.array_equal(a, b) for a, b in zip(parts, again, strict=True))


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_cover_leaves_no_point_outside_and_loses_none(seed):
    rng = np.random.default_rng(seed)
    parts = [hull_corners(rng.normal(c, 0.5, (12, 3))) for c in (-1.0, 1.0)]
    points = rng.normal(0, 2, (50, 3))
    covered = cover(parts, points)
    assert np.min([beyond_hull(p, points) for p in covered], axis=0).max() < 1e-9
    for before, after in zip(parts, covered, strict=True):
        assert beyond_hull(after, before).max() < 1e-9


def test_the_union_is_one_closed_surface_of_known_volume():
    boxes = [np.asarray(solids.box(0.1, 0.1, 0.1).vertices) + [x, 0, 0] for x in (0.0, 0.05)]
    vertices, faces = union_of_hulls(boxes)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.15 * 0.1 * 0.1, rel=1e-6)
