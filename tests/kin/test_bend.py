"""Bends keep symmetric what is symmetric, do not fold, and make one shape of the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import TABLE, in_camera, photograph, placed

from brrp_cli.config import preset
from brrp_cli.geometry import transform_points
from brrp_cli.kin import bend
from brrp_cli.kin.bending import BENT_UNKNOWNS, BentFit, BoxPoints
from brrp_cli.kin.evidence import gather
from brrp_cli.kin.stretched import BentShape, bent_shape
from brrp_cli.kin.ways_out import ways_out
from brrp_cli.shapes import solids

ID = 5
CONFIG = preset("default").hypotheses
KIN = CONFIG.kin
RNG = np.random.default_rng(0)
HALF = np.array([0.06, 0.05, 0.04])


def some_fit(bend_deviation=0.03, **changes) -> BentFit:
    curved = bend_deviation * RNG.normal(size=(3, bend.TERMS))
    fit = BentFit(HALF, 0.4, np.array([0.02, -0.01, 0.05]), 1.1 * HALF, 0.15, curved)
    return replace(fit, **changes)


def evidence_of(mesh):
    frame = photograph({ID: mesh})
    rng = np.random.default_rng(0)
    return gather(frame.object_points(ID), frame, ID, TABLE, KIN, CONFIG.sensor, rng)


def test_slopes_are_those_of_the_terms():
    u = RNG.uniform(-1, 1, (50, 3))
    for axis, step in enumerate(1e-6 * np.eye(3)):
        quotient = (bend.terms(u + step) - bend.terms(u - step)) / 2e-6
        assert quotient == pytest.approx(bend.slopes(u)[:, :, axis], abs=1e-6)


def test_a_bend_is_made_flat_enough_not_to_fold():
    steep = RNG.normal(size=(3, bend.TERMS))
    flat = bend.unfolded(steep, 0.6)
    u = RNG.uniform(-1, 1, (500, 3))
    jacobian = np.eye(3) + np.einsum("ak,nkj->naj", flat, bend.slopes(u))
    assert (np.linalg.det(jacobian) > 0).all()
    assert bend.unfolded(0.001 * steep, 0.6) == pytest.approx(0.001 * steep)


def test_the_prior_asks_least_of_what_stays_symmetric():
    """Energy of the same displacement at the box's side: round, left and right alike, any."""
    precision = bend.prior_precision(HALF, KIN)

    def energy(*entries):
        coefficients = np.zeros((3, bend.TERMS))
        for axis, powers in entries:
            coefficients[axis, bend.row(powers)] = 1
        return float(coefficients.ravel() @ precision @ coefficients.ravel())

    round_ = energy((0, (1, 0, 2)), (1, (0, 1, 2)))
    even = energy((0, (1, 0, 2)), (1, (0, 3, 0)))
    any_ = energy((0, (0, 1, 1)), (1, (1, 0, 1)))
    assert round_ < even / 3 and even < any_ / 3
    assert energy((0, (1, 0, 0))) > 1e4, "a scale is not a bend"


def test_leaning_is_a_small_rotation():
    """The prior's two leaning modes move points as a rotation about x or y does."""
    (one, other) = bend.leaning(HALF)
    u = RNG.uniform(-1, 1, (20, 3))
    for mode, axis in ((one, [0, 1, 0]), (other, [-1, 0, 0])):
        coefficients = np.zeros((3, bend.TERMS))
        for row, powers, size in mode:
            coefficients[row, bend.row(powers)] = size
        moved = (bend.terms(u) @ coefficients.T) * HALF
        assert moved == pytest.approx(np.cross(axis, u * HALF))


@pytest.mark.parametrize("unknown", range(BENT_UNKNOWNS))
def test_points_go_along_each_unknown_as_the_difference_quotient_says(unknown):
    fit = some_fit(taper=0.0)
    u, way = RNG.uniform(-0.9, 0.9, (30, 3)), RNG.normal(size=(30, 3))
    step = np.zeros(BENT_UNKNOWNS)
    step[unknown] = 1e-5
    loose = replace(KIN, bend_steepest=0.99)
    ends = [fit.stepped(sign * step, loose).placed(BoxPoints(u)) for sign in (1, -1)]
    quotient = np.einsum("ni,ni->n", (ends[0] - ends[1]) / 2e-5, way)
    assert fit.along(BoxPoints(u), way)[unknown] == pytest.approx(quotient, abs=2e-4)


def test_normals_are_those_of_the_bent_surface():
    """A plane of the box, bent: its tangents stay at right angles to the normal."""
    fit = some_fit(taper=0.0)
    u = RNG.uniform(-0.8, 0.8, (40, 3))
    u[:, 2] = 0.5
    normal = fit.normals(BoxPoints(u), np.tile([0.0, 0.0, 1.0], (40, 1)))
    for step in (np.array([1e-5, 0, 0]), np.array([0, 1e-5, 0])):
        tangent = fit.placed(BoxPoints(u + step)) - fit.placed(BoxPoints(u - step))
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        assert np.einsum("ni,ni->n", tangent, normal) == pytest.approx(0, abs=1e-4)


def test_the_way_out_is_the_nearest():
    """A point beside a box goes back to its silhouette, one in front of it away from the camera,
    one under the table upwards; one inside stays."""
    evidence = evidence_of(in_camera(solids.box(0.10, 0.10, 0.10), placed(0.0, 0.0, 0.0)))
    T_plane_world = np.linalg.inv(evidence.T_cam_plane) @ placed(0.0, 0.0, 0.0)
    low, inside = transform_points(T_plane_world, np.array([[0.0, 0.0, -0.02], [0.0, 0.0, 0.05]]))
    toward = (evidence.eye - inside) / np.linalg.norm(evidence.eye - inside)
    aside = np.cross(toward, [0, 0, 1.0])
    aside /= np.linalg.norm(aside)
    points = np.stack([inside + 0.11 * toward, inside + 0.1 * aside, low, inside])
    amount, way = ways_out(points, evidence, KIN)
    assert 0.01 < amount[0] < 0.08 and way[0] @ -toward > 0.99
    assert 0.01 < amount[1] < 0.05 and way[1] @ aside < -0.9
    assert amount[2] == pytest.approx(0.02 - KIN.tolerance) and way[2] @ [0, 0, 1] == 1
    assert amount[3] == 0


def test_a_cup_becomes_one_with_other_sides_on_the_far_side_too():
    """A straight beaker, bent onto a picture of one whose sides bulge: round bends are cheap, so
    that the side that nobody saw bulges too."""
    height, radius = 0.09, 0.04
    straight = solids.beaker(radius, radius, height, 0.003).subdivide().subdivide()
    half, middle = np.array([radius, radius, height / 2]), np.array([0, 0, height / 2])
    u = (straight.vertices - middle) / half
    wide = 1 + 0.2 * (1 - u[:, [2]] ** 2)
    truth = straight.copy()
    truth.vertices = np.column_stack([u[:, :2] * wide, u[:, 2]]) * half + middle
    T_cam_world = placed(0.0, 0.0, 0.0)
    evidence = evidence_of(in_camera(truth, T_cam_world))
    T_plane_world = np.linalg.inv(evidence.T_cam_plane) @ T_cam_world
    turn = float(np.arctan2(T_plane_world[1, 0], T_plane_world[0, 0]))
    at = transform_points(T_plane_world, middle[None])[0]
    begun = BentFit(half, turn, at, half, 0.0, np.zeros((3, bend.TERMS)))
    grey = np.full(u.shape, 128, np.uint8)
    shape = BentShape(begun, np.inf, u, np.asarray(straight.faces, np.int32), grey)
    fit = bent_shape(shape, evidence, KIN, np.random.default_rng(0)).fit
    truth.apply_transform(T_plane_world)
    hidden = truth.vertex_normals @ (evidence.eye - at) < 0
    bulging = hidden & (np.abs(u[:, 2]) < 0.5)

    def off(one):
        """Metres along the true normals."""
        apart = one.placed(BoxPoints(u)) - truth.vertices
        return np.abs(np.einsum("ni,ni->n", apart, truth.vertex_normals))

    for rows in (np.ones(len(u), bool), bulging):
        assert off(fit)[rows].mean() < off(begun)[rows].mean() / 2
