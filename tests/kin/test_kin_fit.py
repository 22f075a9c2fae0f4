"""Stretched shapes are found again with their scales; what nothing is like keeps its completion."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from table_scene import TABLE, box, in_camera, photograph, placed

from brrp_cli import open_posterior, reconstruct, write_results
from brrp_cli.config import preset
from brrp_cli.geometry import transform_points
from brrp_cli.kin.evidence import gather
from brrp_cli.kin.fit import fit_kin
from brrp_cli.kin.kept_library import kin_library
from brrp_cli.kin.placement import KinPlacements, coarse_distance, distance_and_slopes
from brrp_cli.kin.refine import refined
from brrp_cli.kin.stretched import unbent_shape
from brrp_cli.methods.kin_hypotheses import kin_shares
from brrp_cli.raycast import inside
from brrp_cli.shapes import solids

ID = 5
CONFIG = preset("default")
KIN = CONFIG.hypotheses.kin
WITHOUT = replace(CONFIG, hypotheses=replace(CONFIG.hypotheses, kin=replace(KIN, enabled=False)))
SCALES = np.array([1.25, 0.80, 1.35])


def bowl():
    return solids.spherical_bowl(0.035, 0.070, 0.050, 0.005)


def of_other_proportions(mesh, scales, yaw=0.0):
    """On the table, camera frame."""
    other = mesh.copy().apply_scale(scales)
    return in_camera(other, placed(0.0, 0.0, yaw))


@pytest.fixture(scope="module")
def seen_bowl(prior):
    truth = of_other_proportions(bowl(), SCALES, yaw=0.3)
    return truth, reconstruct(photograph({ID: truth}), prior)


def test_a_stretched_box_is_found_with_its_scales(prior):
    truth = of_other_proportions(box(), (1.3, 1.5, 0.8), yaw=1.2)
    frame = photograph({ID: truth})
    # The picture is coarse, a pixel is 2.3 mm, and its masks are exact: all around them is told.
    exact = replace(KIN, ring=(1, 8), blur=0)
    rng = np.random.default_rng(0)
    sensor = CONFIG.hypotheses.sensor
    evidence = gather(frame.object_points(ID), frame, ID, TABLE, exact, sensor, rng)
    library = kin_library(prior, exact)
    fits = fit_kin(evidence, library, exact)
    best = fits.placements
    assert library.names[library.object[best.stance[0]]] == "box"
    assert 2 * np.sort(best.half[0]) == pytest.approx([0.090, 0.112, 0.130], rel=0.1)
    assert fits.violation[0] < 0.03 and fits.near[0] > 0.8


def test_a_stretched_bowl_is_like_the_bowl(seen_bowl):
    _, result = seen_bowl
    item = result.objects[0]
    assert item.recognised is None and item.like.name == "bowl"
    x, y, z = item.like.scales
    assert sorted([x, y]) == pytest.approx([0.80, 1.25], rel=0.1)
    assert z == pytest.approx(1.35, rel=0.1)
    assert sum(each.weight for each in item.similar) <= item.unknown_weight


def test_a_bowl_stays_hollow_and_whole(seen_bowl):
    truth, result = seen_bowl
    mesh = result.objects[0].surface.as_trimesh()
    assert mesh.is_watertight and mesh.body_count == 1
    assert mesh.volume == pytest.approx(truth.volume, rel=0.35)
    cavity = np.array([[0.0, 0.0, z] for z in (0.025, 0.04, 0.06)])
    T_cam_world = placed(0.0, 0.0, 0.0)
    assert not inside(mesh, transform_points(T_cam_world, cavity)).any()
    bottom = np.array([[0.0, 0.0, 0.003]])
    assert inside(mesh, transform_points(T_cam_world, bottom)).all(), "its bottom is hidden"


def test_the_files_tell_what_it_is_like(seen_bowl, tmp_path):
    _, result = seen_bowl
    write_results(result, tmp_path / "out")
    told = json.loads((tmp_path / "out" / "result.json").read_text())["objects"][0]
    assert told["like"] == "bowl" and told["recognised"] is None
    assert told["similar"][0]["scales"] == list(result.objects[0].like.scales)
    posterior = result.objects[0].posterior
    read = open_posterior(tmp_path / "out" / "posterior.h5")[ID]
    points = np.random.default_rng(0).uniform(*posterior.bounds, (500, 3))
    assert read.probability(points) == pytest.approx(posterior.probability(points), abs=2e-3)
    assert read.means[read.dominant].kin


def test_what_nothing_is_like_keeps_its_completion(prior):
    """Three bars along three axes: no box, bowl or can, however stretched."""
    hook = solids.union(
        solids.box(0.20, 0.02, 0.02),
        solids.moved(solids.box(0.02, 0.02, 0.16), x=-0.09),
        solids.moved(solids.box(0.02, 0.14, 0.02), x=0.09, y=0.06),
    )
    frame = photograph({ID: in_camera(hook, placed(0.0, -0.02, 0.4))})
    found = [reconstruct(frame, prior, config=each).objects[0] for each in (CONFIG, WITHOUT)]
    assert found[0].similar == [] and found[0].like is None
    assert found[0].surface.vertices.tobytes() == found[1].surface.vertices.tobytes()


def test_few_points_and_bad_fits_leave_the_weight_to_the_completion():
    score, solid, walls = np.array([0.9, 0.9]), np.zeros(2), np.full(2, 0.7)

    def shares(score, hollow, seen=400, into=0.0):
        return kin_shares(score, hollow, seen, into, KIN)

    assert shares(score, walls) == pytest.approx([0.5, 0.5], abs=1e-3)
    assert shares(score, walls, seen=KIN.many_seen // 5).sum() == pytest.approx(0.2, abs=1e-3)
    assert shares(score, solid).sum() == pytest.approx(KIN.solid_most, abs=1e-3)
    assert shares(score - 1.3, walls).sum() < 1e-3
    for into, bonus in ((0.0, KIN.hollow_bonus), (0.3, KIN.opening_bonus)):
        at = KIN.convincing - bonus - np.array([0.0, 0.1])
        assert shares(at, walls, into=into).sum() == pytest.approx(0.5)
        assert shares(at, walls, into=into)[1] < 0.1
        solids_share = KIN.solid_most / (1 + np.exp(KIN.sharpness * bonus))
        assert shares(at, solid, into=into).sum() == pytest.approx(solids_share)


@pytest.mark.parametrize("taper", [0.0, 0.2])
def test_distances_and_slopes_are_those_of_the_stretched_mesh(prior, taper):
    """Near the surface, first order is all there is; the slope is the difference quotient."""
    library = kin_library(prior, KIN)
    stance = next(i for i, o in enumerate(library.object) if library.names[o] == "can")
    half = library.half[stance] * [1.2, 0.9, 1.1]
    at = KinPlacements(
        np.array([stance]),
        np.array([0.4], np.float32),
        np.array([[0.02, -0.01, half[2]]], np.float32),
        half[None].astype(np.float32),
        np.array([taper], np.float32),
    )
    unbent = unbent_shape(at, 0, prior.load("can").shape, library)
    shape = unbent.shape(KIN)
    rng = np.random.default_rng(0)
    mesh = np.asarray(shape.vertices, np.float64)
    near = mesh[rng.integers(len(mesh), size=400)] + rng.normal(0, 0.002, (400, 3))
    on_plane = transform_points(unbent.T_plane_shape, near).astype(np.float32)
    found, _, _, across = distance_and_slopes(at, on_plane, library)
    exact = shape.signed_distance(near, 0.05)
    assert np.abs(found[0] - exact).mean() < 0.0006
    # Along the axes of the turned box, away from edges.
    step = 0.001
    for axis in range(3):
        moved = near + step * np.eye(3)[axis]
        quotient = (shape.signed_distance(moved, 0.05) - exact) / step
        assert np.median(np.abs(quotient - across[axis, 0])) < 0.12


@pytest.mark.parametrize("taper", [0.0, 0.2])
def test_coarse_distances_are_right_to_half_a_node_and_grow_off_the_grid(prior, taper):
    library = kin_library(prior, KIN)
    stances = np.arange(len(library.object))
    rng = np.random.default_rng(0)
    half = (library.half * rng.uniform(0.8, 1.25, (len(stances), 3))).astype(np.float32)
    at = KinPlacements(
        stances,
        rng.uniform(0, 2 * np.pi, len(stances)).astype(np.float32),
        rng.normal(0, 0.02, (len(stances), 3)).astype(np.float32),
        half,
        np.full(len(stances), taper, np.float32),
    )
    within = at.placed(library.surface[:, :50])
    node = 2 * library.reach / (KIN.nodes - 1) * half.max(axis=1)
    for row in range(len(stances)):
        one = at[np.array([row])]
        points = np.ascontiguousarray(within[:, row].T)
        coarse, exact = (
            coarse_distance(one, points, library),
            distance_and_slopes(one, points, library),
        )
        assert np.abs(coarse - exact[0]).mean() < node[row] / 2
        away = points[:1] + np.array([[0.0, 0.0, 1.0]], np.float32)
        further = away + np.array([[0.0, 0.0, 0.5]], np.float32)
        nearer, off = (coarse_distance(one, some, library)[0, 0] for some in (away, further))
        assert off - nearer == pytest.approx(0.5, abs=0.01)


def test_a_library_is_the_same_whoever_asks(prior):
    assert kin_library(prior, KIN) is kin_library(prior, KIN)
    other = kin_library(prior, replace(KIN, poses=1))
    assert len(other.object) == 3 and set(other.names) == {"box", "bowl", "can"}
    hollow = dict(zip(other.names, other.hollow, strict=True))
    assert hollow["bowl"] > 0.4 and hollow["box"] < 0.05 and hollow["can"] < 0.05


def test_a_step_that_no_point_says_anything_about_is_none(prior):
    """Far from everything that was seen, nothing holds the turn."""
    frame = photograph({ID: of_other_proportions(bowl(), SCALES)})
    points = frame.object_points(ID)
    sensor = CONFIG.hypotheses.sensor
    evidence = gather(points, frame, ID, TABLE, KIN, sensor, np.random.default_rng(0))
    library = kin_library(prior, KIN)
    half = library.half[:1]
    far = KinPlacements(
        np.array([0]),
        np.array([0.3], np.float32),
        np.array([[1e4, -1e4, half[0, 2]]], np.float32),
        half,
        np.zeros(1, np.float32),
    )
    moved = refined(far, evidence, library, KIN)
    assert moved.turn[0] == pytest.approx(0.3, abs=1e-3)
    assert np.isfinite(moved.half).all() and np.isfinite(moved.middle).all()


def test_without_a_plane_there_is_no_kin(prior):
    truth = of_other_proportions(bowl(), SCALES)
    found = reconstruct(photograph({ID: truth}, table=False), prior).objects[0]
    assert found.similar == []
