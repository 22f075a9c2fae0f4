"""Grasps carried out in MuJoCo whose outcomes are known, and the tables of them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

pytest.importorskip("mujoco")
from grasp_trial.bodies import TrueBody
from grasp_trial.report import report
from grasp_trial.trial import HELD, HIT_NEIGHBOUR, HIT_TABLE, MISSED, SLIPPED, Trials

from brrp_cli.grasping.gripper_file import open_gripper
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


def test_a_wedge_slips_out():
    """Its sides lean by 40 degrees, half of it each; the friction cone has 17."""
    wedge = solids.box(0.05, 0.005, 0.06)
    vertices = np.asarray(wedge.vertices).copy()
    vertices[:, 1] += np.sign(vertices[:, 1]) * (0.06 - vertices[:, 2]) * np.tan(np.deg2rad(40)) / 2
    wedge = trimesh.Trimesh(vertices, wedge.faces)
    body = TrueBody(1, wedge, [vertices], np.eye(4))
    steep = Trials([body], FRANKA, 0.3)
    assert steep.attempt(1, from_above(0.0, 0.03), 0.08, APPROACH).result == SLIPPED


def test_the_same_grasp_ends_the_same(trials):
    T = from_above(0.0, 0.06)
    T[:3, 3] += [0.0, 0.004, 0.001]
    first, second = (trials.attempt(1, T, 0.08, APPROACH) for _ in range(2))
    assert first == second


def test_the_report_counts_what_was_carried_out():
    rows = []
    for scene in range(10):
        common = {"set": "prior", "scene": f"prior/{scene}", "object": 1, "drift": 0.0}
        common |= {"rank": "best", "score": 0.9}
        rows.append(common | {"method": "default", "result": HELD if scene else SLIPPED})
        rows.append(common | {"method": "mean mesh", "result": HELD if scene > 4 else MISSED})
        # What moved by itself says nothing about a grasp.
        rows.append(common | {"method": "default", "result": MISSED, "drift": 0.1})
    rows.append(common | {"method": "default", "result": "none", "score": None, "drift": None})
    told = report(rows, drift=0.005)
    assert "| default | prior | 90% (70% to 100%), 10 | 10 of 11 |" in told
    assert "| mean mesh | prior | 50% (20% to 80%), 10 | 10 of 10 |" in told
    assert "| default | 9 | 0 | 0 | 0 | 0 | 1 | 0 |" in told
    assert "| 0.9 to 0.97 | 10 | 0.90 | 90%" in told and "calibration error: 0.00" in told
    assert "10 objects of which both plan a grasp: +40%" in told
