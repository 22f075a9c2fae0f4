"""What is taken for round about an axis, and what is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from turned_shapes import frustum, turned_and_moved, two_faces

from brrp_cli.completion.revolution_axis import Axis, upright_axis
from brrp_cli.completion.roundness import axis_of, roundness_about
from brrp_cli.config import RevolutionConfig

CONFIG = RevolutionConfig()
UP = np.array([0.0, 0.0, 1.0])


def test_a_can_is_round_about_its_axis_and_not_about_one_beside_it():
    points, normals = frustum(0.04, 0.04, 0.1)
    about = roundness_about(Axis(np.zeros(3), UP), points, normals, CONFIG)
    assert about.aside == about.round == 1
    assert about.covered == pytest.approx(0.5, abs=0.06)
    assert about.scatter < 1e-4
    beside = roundness_about(Axis(np.array([0.0, 0.02, 0.0]), UP), points, normals, CONFIG)
    assert beside.round < about.round and beside.scatter > 10 * about.scatter


@pytest.mark.parametrize("shape", [(0.04, 0.04, 0.1), (0.02, 0.05, 0.12), (0.01, 0.12, 0.06)])
def test_round_things_have_an_axis_wherever_they_point(shape):
    points, normals = frustum(*shape, count=3000, noise=0.05)
    standing = axis_of(points, normals, UP, CONFIG)
    assert standing is not None and abs(standing.direction @ UP) > 0.999
    points, normals, T = turned_and_moved(points, normals)
    lying = axis_of(points, normals, UP, CONFIG)
    assert lying is not None and abs(lying.direction @ T[:3, 2]) > 0.999


@pytest.mark.parametrize("width", [0.03, 0.06, 0.2])
def test_a_box_has_none(width):
    assert axis_of(*two_faces(width, 0.1), UP, CONFIG) is None


def test_one_face_has_none():
    """It may be part of something round that is very large."""
    points, normals = two_faces(0.1, 0.1)
    face = normals[:, 0] > 0.5
    assert axis_of(points[face], normals[face], UP, CONFIG) is None


def test_too_little_of_a_can_has_none():
    points, normals = frustum(0.04, 0.04, 0.1, seen=np.radians(60))
    assert axis_of(points, normals, UP, CONFIG) is None
    few = CONFIG.least_points - 1
    points, normals = frustum(0.04, 0.04, 0.1, count=few)
    assert axis_of(points, normals, UP, CONFIG) is None


def test_it_can_be_switched_off():
    can = frustum(0.04, 0.04, 0.1)
    assert axis_of(*can, UP, CONFIG) is not None
    assert axis_of(*can, UP, replace(CONFIG, enabled=False)) is None


def test_an_upright_axis_is_taken_where_it_is_as_good():
    """A ball is round about every axis."""
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(2000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals[normals @ [1, 0, 1] > 0]
    found = axis_of(0.04 * normals, normals, UP, CONFIG)
    assert found is not None and abs(found.direction @ UP) > 0.999


@pytest.mark.parametrize(("astray", "told"), [(0.19, True), (0.3, False)])
def test_wavy_depth_leaves_a_can_round_until_too_many_of_its_normals_are_astray(astray, told):
    points, normals = frustum(0.04, 0.04, 0.1, count=2000)
    rng = np.random.default_rng(0)
    lost = rng.random(len(points)) < astray
    other = rng.normal(size=(int(lost.sum()), 3))
    normals[lost] = other / np.linalg.norm(other, axis=1, keepdims=True)
    assert (axis_of(points, normals, UP, CONFIG) is not None) == told


@pytest.mark.parametrize("axis", [0, 1])
def test_an_oval_bottle_is_told_from_a_round_one(axis):
    """Seen from its narrow and from its broad side."""
    found = {}
    for squeezed in (1.0, 0.9, 0.75, 0.6):
        scale = np.ones(3)
        scale[axis] = squeezed
        points, normals = frustum(0.04, 0.05, 0.15, count=2000)
        points, normals = points * scale, normals / scale
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        upright = upright_axis(points, normals, UP, CONFIG.off, CONFIG.steps)
        found[squeezed] = roundness_about(upright, points, normals, CONFIG).oval
        has_axis = axis_of(points, normals, UP, CONFIG) is not None
        assert has_axis == (squeezed >= 0.9), squeezed
    assert found[1.0] == pytest.approx(0, abs=0.02)
    # (1 - 0.9) / 0.95, and (1 - 0.75) / 0.875
    assert found[0.9] == pytest.approx(0.105, abs=0.03)
    assert found[0.75] == pytest.approx(0.286, abs=0.09)


def looked_into(squeezed=1.0):
    """The inner side of a cone, as wide across as a share of what it is along x."""
    points, normals = frustum(0.02, 0.05, 0.06, count=1500, seen=1.5 * np.pi)
    points, normals = points * [1, squeezed, 1], normals / [1, squeezed, 1]
    return points, -normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_what_is_seen_of_the_inside_tells_an_oval_bowl_too():
    for squeezed in (1.0, 0.9, 0.7):
        points, normals = looked_into(squeezed)
        upright = upright_axis(points, normals, UP, CONFIG.off, CONFIG.steps)
        found = roundness_about(upright, points, normals, CONFIG).oval
        # (1 - 0.9) / 0.95, and (1 - 0.7) / 0.85
        assert found == pytest.approx((1 - squeezed) / ((1 + squeezed) / 2), abs=0.05), squeezed


def test_the_thin_stem_of_a_glass_does_not_make_it_oval():
    """Depth that is off by a millimetre is off by a quarter of its radius."""
    rng = np.random.default_rng(0)
    inner, inner_normals = looked_into()
    stem, stem_normals = frustum(0.004, 0.004, 0.08, count=150)
    points = np.concatenate([inner, stem - [0, 0, 0.08]])
    normals = np.concatenate([inner_normals, stem_normals])
    points += 0.001 * rng.standard_normal((len(points), 1)) * normals
    axis = upright_axis(points, normals, UP, CONFIG.off, CONFIG.steps)
    assert roundness_about(axis, points, normals, CONFIG).oval < 0.05
    assert axis_of(points, normals, UP, CONFIG) is not None
