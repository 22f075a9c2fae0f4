"""One grasp, open loop: come in from the pre-grasp, close, lift, shake."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import transform_points
from brrp_cli.grasping.gripper import Gripper
from brrp_cli.observation.support_plane import Plane
from grasp_trial.bodies import TrueBody
from grasp_trial.world import STEP, back_along, world_xml

Array = NDArray[np.float64]

HELD = "held"
HIT_TABLE, HIT_NEIGHBOUR, HIT_OBJECT = "hit the table", "hit a neighbour", "hit the object"
MISSED, SLIPPED, DROPPED = "closed on nothing", "slipped", "dropped"
# Ends of phases, as `watch` is told them.
PRE_GRASP, IN, CLOSED, LIFTED, SHAKEN = "pre-grasp", "come in", "closed", "lifted", "shaken"
OUTCOMES = (HELD, HIT_OBJECT, HIT_NEIGHBOUR, HIT_TABLE, MISSED, SLIPPED, DROPPED)

SETTLE, APPROACH, CLOSE, LIFT, SHAKE = 0.2, 0.4, 0.5, 0.6, 0.8  # seconds
HEIGHT = 0.2  # metres
# An object that the open hand moves by more than this was hit, metres.
MOVED = 0.004
SHAKES, ASIDE, TURN = 3.0, 0.03, np.deg2rad(15)  # Hz, metres, radians
# Of what is held: it rose by so much of the lift.
ROSE = 0.6
TABLE = Plane(np.array([0.0, 0.0, 1.0]), 0.0)
# T_world_gripper of a hand that is in nobody's way, 2 m over the table.
AWAY = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 2], [0, 0, 0, 1]])


@dataclass(frozen=True)
class Outcome:
    """result : one of OUTCOMES; drift : metres that a point of the object moves at most, if no hand
    comes, until it would be lifted."""

    result: str
    drift: float


class Trials:
    """One scene, in which grasps are carried out one after the other, each from the start."""

    def __init__(self, bodies: Sequence[TrueBody], gripper: Gripper, friction: float) -> None:
        import mujoco

        self.mj, self.gripper = mujoco, gripper
        self.model = mujoco.MjModel.from_xml_string(world_xml(bodies, gripper, friction))
        self.start = mujoco.MjData(self.model)
        self.ids = [body.object_id for body in bodies]
        self._place(self.start, AWAY, gripper.opening)
        self._run(self.start, SETTLE)
        left_alone = mujoco.MjData(self.model)
        left_alone.qpos[:] = self.start.qpos
        self._place(left_alone, AWAY, gripper.opening)
        self._run(left_alone, APPROACH + CLOSE)
        self.drift = {body.object_id: _moved(body, left_alone) for body in bodies}

    def attempt(
        self,
        object_id: int,
        T_world_gripper: Array,
        opening: float,
        approach: float,
        watch: Callable[[str, Any], None] = lambda _phase, _data: None,
    ) -> Outcome:
        """Carry out one grasp. watch : called at the end of each phase with its name."""
        result = self._attempt(object_id, T_world_gripper, opening, approach, watch)
        return Outcome(result, self.drift[object_id])

    def _attempt(
        self, object_id: int, T: Array, opening: float, approach: float, watch: Callable[..., None]
    ) -> str:
        data = self.mj.MjData(self.model)
        data.qpos[:], data.qvel[:] = self.start.qpos, 0
        before = {i: self._where(data, i, forward=True) for i in self.ids}
        self._place(data, back_along(T, approach), opening)
        watch(PRE_GRASP, data)
        if self.gripper.lowest(T[None], np.array([opening]), TABLE)[0] < 0:
            return HIT_TABLE
        hit = self._come_in(data, T, approach, object_id, before)
        watch(IN, data)
        if hit:
            return hit
        touched = self._close(data, object_id)
        watch(CLOSED, data)
        if self._width(data) < 5e-4:
            return SLIPPED if touched else MISSED
        held = self._where(data, object_id)
        self._run(data, LIFT, lambda s: T + _at([0, 0, HEIGHT * _smooth(s)]))
        watch(LIFTED, data)
        if self._where(data, object_id)[2] - held[2] < ROSE * HEIGHT:
            return SLIPPED
        self._run(data, SHAKE, lambda s: _shaken(T + _at([0, 0, HEIGHT]), s))
        watch(SHAKEN, data)
        return HELD if self._where(data, object_id)[2] - held[2] > ROSE * HEIGHT else DROPPED

    def _come_in(
        self, data: Any, T: Array, approach: float, object_id: int, before: dict[int, Array]
    ) -> str:
        parts = 10
        for k in range(parts):
            done = [k / parts, (k + 1) / parts]
            self._run(
                data,
                APPROACH / parts,
                lambda s, d=done: back_along(T, approach * (1 - d[0] - s * (d[1] - d[0]))),
            )
            for i in self.ids:
                if np.linalg.norm(self._where(data, i) - before[i]) > MOVED and self._touching(
                    data, i
                ):
                    return HIT_OBJECT if i == object_id else HIT_NEIGHBOUR
        return ""

    def _touching(self, data: Any, object_id: int) -> set[str]:
        """Which parts of the hand touch the object now."""
        found: set[str] = set()
        for contact in data.contact[: data.ncon]:
            names = {self._body_of(contact.geom1), self._body_of(contact.geom2)}
            if f"object_{object_id}" in names:
                found |= names & {"hand", "left", "right"}
        return found

    def _close(self, data: Any, object_id: int) -> bool:
        """Close the fingers; whether both touched the object on the way."""
        touched: set[str] = set()
        start = data.ctrl.copy()
        steps = round(CLOSE / STEP)
        for k in range(steps):
            # Further than closed, so that the whole force is there at the end.
            share = min(1.0, 1.5 * (k + 1) / steps)
            data.ctrl[:] = start + share * (self.gripper.opening / 2 + 0.05 - start)
            self.mj.mj_step(self.model, data)
            if k % 5 == 0:
                touched |= self._touching(data, object_id)
        return {"left", "right"} <= touched

    def _place(self, data: Any, T: Array, opening: float) -> None:
        """Put the hand there, at rest, open by `opening`."""
        self._move(data, T)
        data.joint("hand").qpos[:] = [*data.mocap_pos[0], *data.mocap_quat[0]]
        bend = (self.gripper.opening - opening) / 2
        for name in ("left", "right"):
            data.joint(name).qpos[0] = bend
            data.actuator(name).ctrl[0] = bend
        self.mj.mj_forward(self.model, data)

    def _move(self, data: Any, T: Array) -> None:
        data.mocap_pos[0] = T[:3, 3]
        self.mj.mju_mat2Quat(data.mocap_quat[0], T[:3, :3].ravel())

    def _run(self, data: Any, seconds: float, way: Callable[[float], Array] | None = None) -> None:
        steps = round(seconds / STEP)
        for k in range(steps):
            if way is not None:
                self._move(data, way((k + 1) / steps))
            self.mj.mj_step(self.model, data)

    def _where(self, data: Any, object_id: int, *, forward: bool = False) -> Array:
        if forward:
            self.mj.mj_kinematics(self.model, data)
        return np.array(data.body(f"object_{object_id}").xpos)

    def _width(self, data: Any) -> float:
        bend = sum(float(data.joint(name).qpos[0]) for name in ("left", "right"))
        return self.gripper.opening - bend

    def _body_of(self, geom: int) -> str:
        return str(self.model.body(self.model.geom_bodyid[geom]).name)


def _moved(body: TrueBody, data: Any) -> float:
    """Metres that the furthest moved point of an object is from where the scene has it."""
    now = data.body(f"object_{body.object_id}")
    corners = np.concatenate(body.parts)
    there = corners @ now.xmat.reshape(3, 3).T + now.xpos
    return float(
        np.linalg.norm(there - transform_points(body.T_world_object, corners), axis=1).max()
    )


def _at(xyz: Sequence[float]) -> Array:
    shift = np.zeros((4, 4))
    shift[:3, 3] = xyz
    return shift


def _smooth(s: float) -> float:
    return s * s * (3 - 2 * s)


def misplaced(T: Array, accuracy: float, angle: float, rng: np.random.Generator) -> Array:
    """T_world_gripper of a robot that misses its pose T by normal errors along and about each axis
    of the hand: standard deviations in metres and degrees, as the planner's score counts them."""
    from scipy.spatial.transform import Rotation

    off = np.eye(4)
    off[:3, :3] = Rotation.from_rotvec(rng.normal(0, np.deg2rad(angle), 3)).as_matrix()
    off[:3, 3] = rng.normal(0, accuracy, 3)
    return np.asarray(T @ off)


def _shaken(T: Array, s: float) -> Array:
    """From side to side, and turned about the vertical and about the approach."""
    from scipy.spatial.transform import Rotation

    phase = 2 * np.pi * SHAKES * SHAKE * s
    fade = min(1.0, 5 * s, 5 * (1 - s))
    moved = T + _at([fade * ASIDE * np.sin(phase), fade * ASIDE * np.sin(0.7 * phase), 0])
    turn = Rotation.from_rotvec(fade * TURN * np.sin(0.5 * phase) * T[:3, 0]).as_matrix()
    moved[:3, :3] = turn @ T[:3, :3]
    return np.asarray(moved)
