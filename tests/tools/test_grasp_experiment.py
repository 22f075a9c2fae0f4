"""Grasps carried out in MuJoCo whose outcomes are known, and the tables of them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation

pytest.importorskip("mujoco")
from grasp_trial.bodies import TrueBody, true_body
from grasp_trial.film import HEIGHT, WIDTH, Film, Take, is_target
from grasp_trial.report import report
from grasp_trial.trial import (
    CLOSED,
    HELD,
    HIT_NEIGHBOUR,
    HIT_TABLE,
    IN,
    LIFTED,
    MISSED,
    PRE_GRASP,
    SHAKEN,
    SLIPPED,
    Trials,
    misplaced,
)

from brrp_cli.grasping.gripper_file import open_gripper
from brrp_cli.ground_truth.truth import TrueObject
from brrp_cli.planning.parts import beyond_hull
from brrp_cli.shapes import solids

FRANKA = open_gripper("franka-hand")
APPROACH = 0.1


def standing(object_id: int, x: float, size: tuple[float, float, float]) -> TrueBody:
    mesh = solids.box(*size)
    T = np.eye(4)
    T[0, 3] = x
    return TrueBody(object_id, mesh, [np.asarray(mesh.vertices)], T)


@pytest.fixture(scope="module")
def trials() -> Trials:
    """A box of 5 x 5 x 10 cm, and one beside it."""
    return Trials(
        [standing(1, 0.0, (0.05, 0.05, 0.1)), standing(2, 0.07, (0.05, 0.05, 0.1))], FRANKA, 0.5
    )


def from_above(x: float, tip_height: float, along: str = "y") -> np.ndarray:
    """A hand that comes straight down and closes along x or y."""
    T = np.eye(4)
    closing = np.array([1.0, 0, 0]) if along == "x" else np.array([0, 1.0, 0])
    T[:3, 0], T[:3, 2] = closing, [0, 0, -1]
    T[:3, 1] = np.cross(T[:3, 2], T[:3, 0])
    T[:3, 3] = [x, 0, tip_height + FRANKA.tip]
    return T


@pytest.mark.parametrize(
    ("T", "result"),
    [
        (from_above(0.0, 0.06), HELD),
        (from_above(-0.3, 0.06), MISSED),
        (from_above(0.0, -0.01), HIT_TABLE),
        # Its right finger comes down on the box beside.
        (from_above(0.0, 0.06, "x"), HIT_NEIGHBOUR),
    ],
)
def test_what_happens_is_told(trials, T, result):
    found = trials.attempt(1, T, 0.08, APPROACH)
    assert found.drift < 0.001
    assert found.result == result


def test_what_falls_over_by_itself_is_told():
    """On its edge, 5 degrees off balance: it has hardly moved when the hand comes."""
    tilted = standing(1, 0.0, (0.05, 0.05, 0.1))
    angle = np.deg2rad(45 + 5)
    tilted.T_world_object[:3, :3] = Rotation.from_rotvec([angle, 0, 0]).as_matrix()
    corners = tilted.mesh.vertices @ tilted.T_world_object[:3, :3].T
    tilted.T_world_object[2, 3] = -corners[:, 2].min()
    still = standing(2, 0.3, (0.05, 0.05, 0.1))
    drift = Trials([tilted, still], FRANKA, 0.5).drift
    assert drift[1] > 0.01 and drift[2] < 0.001


def test_a_wedge_slips_out():
    """Its sides lean by 40 degrees, half of it each; the friction cone has 17."""
    wedge = solids.box(0.05, 0.005, 0.06)
    vertices = np.asarray(wedge.vertices).copy()
    vertices[:, 1] += np.sign(vertices[:, 1]) * (0.06 - vertices[:, 2]) * np.tan(np.deg2rad(40)) / 2
    wedge = trimesh.Trimesh(vertices, wedge.faces)
    body = TrueBody(1, wedge, [vertices], np.eye(4))
    steep = Trials([body], FRANKA, 0.3)
    assert steep.attempt(1, from_above(0.0, 0.03), 0.08, APPROACH).result == SLIPPED


def test_a_robot_misses_its_pose_by_what_it_is_said_to():
    rng, T = np.random.default_rng(0), from_above(0.1, 0.06)
    found = np.stack([np.linalg.inv(T) @ misplaced(T, 0.001, 0.5, rng) for _ in range(2000)])
    np.testing.assert_allclose(found[:, :3, 3].std(axis=0), 0.001, rtol=0.06)
    turns = np.rad2deg(Rotation.from_matrix(found[:, :3, :3]).as_rotvec())
    np.testing.assert_allclose(turns.std(axis=0), 0.5, rtol=0.06)


def test_the_same_grasp_ends_the_same(trials):
    T = from_above(0.0, 0.06)
    T[:3, 3] += [0.0, 0.004, 0.001]
    first, second = (trials.attempt(1, T, 0.08, APPROACH) for _ in range(2))
    assert first == second


def test_the_film_shows_a_box_that_rises_and_a_hand_that_fails(trials, tmp_path):
    film = Film(held=1, failed=1)
    for T in (from_above(0.0, -0.01), from_above(0.0, 0.06)):
        take = Take(trials.model, "object_1", np.array([0, 0, 0.06]))
        result = trials.attempt(1, T, 0.08, APPROACH, take).result
        assert film.wants(result)
        film.add("default", result, take)
        assert not film.wants(result)
    assert [label for label, _ in film.rows] == [f"default: {HIT_TABLE}", f"default: {HELD}"]
    failed, held = (pictures for _, pictures in film.rows)
    # The table is hit before the hand comes in: one picture.
    assert [picture is not None for picture in failed] == [True, False, False, False, False]
    rows = [np.nonzero(is_target(picture))[0].mean() for picture in held]
    assert list(take.states) == [PRE_GRASP, IN, CLOSED, LIFTED, SHAKEN]
    assert rows[0] == pytest.approx(rows[2], abs=6)
    assert rows[3] < rows[2] - 40 and rows[4] == pytest.approx(rows[3], abs=15)
    film.save(tmp_path / "film.png")
    sheet = np.asarray(Image.open(tmp_path / "film.png"))
    assert sheet.shape[1] == 5 * WIDTH and sheet.shape[0] > 2 * HEIGHT
    # Those that held come first.
    assert np.array_equal(sheet[-HEIGHT:, :WIDTH], failed[0])


def test_the_report_counts_what_was_carried_out():
    rows = []
    for scene in range(10):
        common = {"set": "prior", "scene": f"prior/{scene}", "object": 1, "drift": 0.0}
        common |= {"rank": 1, "score": 0.9}
        rows.append(common | {"method": "default", "result": HELD if scene else SLIPPED})
        rows.append(common | {"method": "mean mesh", "result": HELD if scene > 4 else MISSED})
        # What moved by itself says nothing about a grasp.
        rows.append(common | {"method": "default", "result": MISSED, "drift": 0.1})
    # Of the last scene: a second grasp, one that was drawn, an object without any.
    rows.append(common | {"method": "mean mesh", "result": HELD, "rank": 2})
    rows.append(common | {"method": "default", "result": HELD, "rank": "drawn"})
    rows.append(common | {"method": "default", "result": "none", "score": None, "drift": None})
    # A scene that one method alone has tried is in its own row, not in the comparison.
    rows.append(common | {"method": "vprism", "result": HELD})
    told = report(rows, drift=0.005)
    assert "| default | prior | 90% (70% to 100%), 10 | 90% (70% to 100%), 10 | 82% (" in told
    assert "), 11 |\n| mean mesh | prior | 55% (" in told
    assert "), 11 | 50% (20% to 80%), 10 | 50% (20% to 80%), 10 |" in told
    assert "| default | 10 | 9 (70% to 100%) | 0 | 0 | 0 | 0 | 1 (0% to 30%) | 0 |" in told
    assert "| mean mesh | prior | +35% (" in told and ") | +32% (" in told
    assert "| vprism | prior | +0% | -50% |" in told
    assert "| 0.9 to 0.97 | 11 | 0.90 | 91%" in told and "calibration error: 0.01" in told
    assert "10 objects of which both plan a grasp: +40%" in told


def test_a_finger_finds_the_neck_of_a_bottle(tmp_path):
    """A groove of 8 mm around a can: no part of the body fills it."""
    profile = [(0, 0), (0.03, 0), (0.03, 0.05), (0.022, 0.055), (0.03, 0.06), (0.03, 0.1), (0, 0.1)]
    solids.revolve(profile).export(tmp_path / "can.obj")
    body = true_body(TrueObject(1, "can.obj", np.eye(4)), tmp_path, tmp_path / "cache")
    turn = np.linspace(0, 2 * np.pi, 24)
    for radius, is_inside in ((0.0265, False), (0.021, True)):
        ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn + 0.055])
        nearest = np.min([beyond_hull(part, ring) for part in body.parts], axis=0)
        assert ((nearest < 1e-6) == is_inside).all()
