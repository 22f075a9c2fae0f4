"""Kin that the camera would see something through are none: what leans is not like what stands."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from table_scene import TABLE, in_camera, photograph, placed

from brrp_cli import reconstruct
from brrp_cli.config import preset
from brrp_cli.geometry import transform_points
from brrp_cli.kin.evidence import gather
from brrp_cli.kin.ways_out import seen_through
from brrp_cli.methods.kin_hypotheses import most_through
from brrp_cli.shapes import solids

ID = 5
CONFIG = preset("default")
KIN = CONFIG.hypotheses.kin
WORLD = placed(0.0, 0.0, 0.0)
# All of it may be.
ANY = (1.0, 1.0)


def test_what_stands_before_what_was_measured_is_seen_through():
    frame = photograph({ID: in_camera(solids.box(0.10, 0.10, 0.10), WORLD)})
    rng = np.random.default_rng(0)
    points = frame.object_points(ID)
    evidence = gather(points, frame, ID, TABLE, KIN, CONFIG.hypotheses.sensor, rng)
    T_plane_world = np.linalg.inv(evidence.T_cam_plane) @ WORLD
    inside = transform_points(T_plane_world, np.array([[0.0, 0.0, 0.05]]))[0]
    toward = (evidence.eye - inside) / np.linalg.norm(evidence.eye - inside)
    before = inside + np.array([0.0, 0.09, 0.11, 0.13])[:, None] * toward
    assert seen_through(before, evidence, 0.005) == 0.75
    assert seen_through(before, evidence, 10.0) == 0
    assert seen_through(before[:1], evidence, 0.005) == 0, "inside"


def test_a_bowl_that_fits_may_stand_before_more_where_the_camera_looks_into_it():
    few, many = KIN.most_through
    well, badly = 0.9 * KIN.most_cost[1], 1.1 * KIN.most_cost[1]
    cost, hollow = np.array([well, badly, well]), np.array([1.0, 1.0, 0.0])
    closed, opened = KIN.opening
    np.testing.assert_allclose(most_through(cost, hollow, opened, KIN), [many, few, few])
    np.testing.assert_allclose(most_through(cost, hollow, closed, KIN), few)


def leaning_bowl():
    bowl = solids.spherical_bowl(0.035, 0.070, 0.050, 0.005).apply_scale((1.25, 0.80, 1.35))
    bowl.apply_transform(trimesh.transformations.rotation_matrix(np.radians(20), [0, 1, 0]))
    return in_camera(solids.moved(bowl, z=-bowl.bounds[0, 2]), WORLD)


def distance(mesh, other):
    """Metres, mean, both ways."""
    a, b = (trimesh.sample.sample_surface(each, 6000, seed=0)[0] for each in (mesh, other))
    return float((cKDTree(a).query(b)[0].mean() + cKDTree(b).query(a)[0].mean()) / 2)


def test_a_leaning_bowl_is_not_like_one_that_stands(prior):
    truth = leaning_bowl()
    frame = photograph({ID: truth})
    found = {}
    for most in (KIN.most_through, ANY):
        kin = replace(KIN, most_through=most)
        config = replace(CONFIG, hypotheses=replace(CONFIG.hypotheses, kin=kin))
        found[most] = reconstruct(frame, prior, config=config).objects[0]
    assert found[ANY].like.name == "bowl" and found[KIN.most_through].like is None
    off = {most: distance(truth, each.surface.as_trimesh()) for most, each in found.items()}
    assert off[KIN.most_through] == pytest.approx(0.002, abs=0.0007)
    assert off[KIN.most_through] < 0.6 * off[ANY]
