"""A scene that rests: bodies moved, as little as it takes, to where they stay when left alone.

What is reconstructed is off by millimetres. Neighbours overlap, and a simulator throws them apart;
bottoms are uneven or hover, and what stands on them falls. MuJoCo finds where the bodies come to
rest, in steps that are damped so that they go there and no further:

1. apart: no weight, no friction, no turning. What overlaps is pushed apart along the contact.
2. drop: with weight. What hovers comes down straight until something carries it.
3. lean: with turning. Bottoms come to lie flat.
4. free: without damping. What would fall falls.

Then the scene is left alone. An object that left its place in steps 3 and 4, or moves when it is
left alone, gets a foot and all is done again: what lies little above its lowest point is drawn down
to it, so that it stands on an even face. The foot grows until the object stays. The last one
reaches under the centre of mass.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.planning import RestConfig
from brrp_cli.dependencies import import_library
from brrp_cli.errors import DependencyError, ResultError
from brrp_cli.geometry import rotation_angle, transform_points
from brrp_cli.planning.body import Body, lift_onto
from brrp_cli.planning.mjcf import Files, TableBox, scene_mjcf
from brrp_cli.planning.parts import hull_corners

Array = NDArray[np.float64]
Poses = dict[str, Array]


@dataclass(frozen=True)
class Rest:
    """One object at rest.

    T_frame_body : (4, 4) where it rests; parts : its convex parts, with the foot; foot : height
    that was drawn down, metres, 0: none; plate : whether the foot reaches under the centre of mass
    moved, turned : from where it was measured, metres, degrees; left_moved, left_turned : in the
    seconds that it was left alone
    """

    T_frame_body: Array
    parts: list[Array]
    foot: float
    plate: bool
    moved: float
    turned: float
    left_moved: float
    left_turned: float


def check_simulator() -> None:
    """DependencyError now, not after the work, without MuJoCo."""
    try:
        import_library("mujoco")
    except DependencyError as error:
        fix = f"{error.fix}; or --no-rest, which leaves objects where they were measured"
        raise DependencyError(error.what, found=error.found, fix=fix) from error


def put_to_rest(bodies: Mapping[str, Body], table: TableBox, config: RestConfig) -> dict[str, Rest]:
    """Where each body rests on the table, by name. The same bodies give the same places. Errors:
    DependencyError without MuJoCo; ResultError where it does not take a shape."""
    levels = dict.fromkeys(bodies, 0)
    standing = _lifted(bodies, table)
    shaped = dict(bodies)
    while True:
        world = _World(shaped, standing, table, config)
        world.apart()
        world.drop()
        dropped = world.poses()
        world.lean()
        world.free()
        resting = world.poses()
        world.leave_alone()
        last = world.poses()
        restless = [
            name
            for name in bodies
            if levels[name] <= len(config.feet)
            and not (
                _within(dropped[name], resting[name], config.leaves, config.leaves_angle)
                and _within(resting[name], last[name], config.stays, config.stays_angle)
            )
        ]
        if not restless:
            break
        for name in restless:
            levels[name] += 1
            at = replace(bodies[name], T_frame_body=dropped[name])
            shaped[name] = replace(bodies[name], parts=_footed(at, table.up, levels[name], config))
    found = {}
    for name, body in bodies.items():
        moved, turned = _between(body.T_frame_body, resting[name])
        left = _between(resting[name], last[name])
        level = levels[name]
        foot = config.feet[min(level, len(config.feet)) - 1] if level else 0.0
        plate = level > len(config.feet)
        found[name] = Rest(resting[name], shaped[name].parts, foot, plate, moved, turned, *left)
    return found


def _footed(body: Body, up: Array, level: int, config: RestConfig) -> list[Array]:
    """Its parts with the `level`-th foot, level >= 1, at its place."""
    T_body_frame = np.linalg.inv(body.T_frame_body)
    placed = [transform_points(body.T_frame_body, part) for part in body.parts]
    heights = [corners @ up for corners in placed]
    lowest = min(float(height.min()) for height in heights)
    reach = config.feet[min(level, len(config.feet)) - 1]
    found, soles = [], []
    for corners, height in zip(placed, heights, strict=True):
        near = height < lowest + reach
        sole = corners[near] - (height[near] - lowest)[:, None] * up
        soles.append(sole)
        found.append(hull_corners(np.vstack([corners, sole])) if near.any() else corners)
    if level > len(config.feet):
        found.append(_plate(np.vstack(soles), body, up, lowest, config))
    return [np.asarray(transform_points(T_body_frame, corners)) for corners in found]


def _plate(sole: Array, body: Body, up: Array, lowest: float, config: RestConfig) -> Array:
    """Corners (k, 3) of a plate that reaches from the sole (n, 3) to under the centre of mass."""
    centre = body.T_frame_body[:3, 3]
    middle = centre - (centre @ up - lowest) * up
    axes = body.T_frame_body[:3, :2]
    axes = axes - np.outer(up, up @ axes)
    angle = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    disc = middle + config.plate * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes.T
    below = np.vstack([sole, disc])
    return hull_corners(np.vstack([below, below + config.plate_thickness * up]))


class _World:
    """The scene as MuJoCo has it, from the file that simulators get."""

    def __init__(
        self, bodies: Mapping[str, Body], poses: Poses, table: TableBox, config: RestConfig
    ) -> None:
        self.mj: Any = import_library("mujoco")
        self.config, self.names = config, list(bodies)
        files: dict[str, Files] = {}
        assets: dict[str, bytes] = {}
        for name, body in bodies.items():
            parts = [f"{name}_part_{i}.obj" for i in range(len(body.parts))]
            files[name] = Files(parts[0], parts)
            assets |= {file: _obj(part) for file, part in zip(parts, body.parts, strict=True)}
        text = scene_mjcf(bodies, files, table, config, poses)
        try:
            self.model = self.mj.MjModel.from_xml_string(text, assets)
        except ValueError as error:
            raise ResultError(
                "MuJoCo does not take the collision shapes",
                found=str(error),
                fix="--no-rest, which leaves objects where they were measured",
            ) from error
        self.data = self.mj.MjData(self.model)
        self.gravity = self.model.opt.gravity.copy()
        self.friction = self.model.geom_friction.copy()

    def apart(self) -> None:
        """No weight, no friction, no turning."""
        self.model.opt.gravity[:] = 0
        self.model.geom_friction[:] = 1e-4
        self.model.geom_solref[:, 0] = self.config.apart_time
        self._run(self.config.apart, self.config.slow, turning=False)
        self.model.geom_solref[:, 0] = self.config.contact_time
        self.model.opt.gravity[:] = self.gravity
        self.model.geom_friction[:] = self.friction

    def drop(self) -> None:
        """No turning."""
        config = self.config
        self._run(config.drop, config.slow, turning=False, until=config.lands)

    def lean(self) -> None:
        """Damped."""
        self._run(self.config.lean, self.config.gentle)

    def free(self) -> None:
        """As it is."""
        self._run(self.config.free, None)

    def leave_alone(self) -> None:
        """As it is, from rest."""
        self._run(self.config.left_alone, None)

    def poses(self) -> Poses:
        """T_frame_body by name."""
        found = {}
        for name in self.names:
            body, T = self.data.body(name), np.eye(4)
            T[:3, :3], T[:3, 3] = body.xmat.reshape(3, 3), body.xpos
            found[name] = T
        return found

    def _run(
        self,
        seconds: float,
        loses: float | None,
        *,
        turning: bool = True,
        until: float = 0.0,
    ) -> None:
        """From rest. loses : a body loses its speed in this time; None: it is not damped; until :
        metres per second, no longer than something is as fast."""
        model, data = self.model, self.data
        model.dof_damping[:] = 0
        for name in self.names:
            number = model.body(name).id
            first = model.body_dofadr[number]
            if loses is not None:
                model.dof_damping[first : first + 3] = model.body_mass[number] / loses
                model.dof_damping[first + 3 : first + 6] = model.body_inertia[number] / loses
            if not turning:
                model.dof_damping[first + 3 : first + 6] = 1e6 * model.body_inertia[number]
        data.qvel[:] = 0
        data.qacc_warmstart[:] = 0
        moving = self._moving()
        for step in range(1, round(seconds / model.opt.timestep) + 1):
            self.mj.mj_step(model, data)
            if step % self.config.look == 0 and np.abs(data.qvel[moving]).max() < until:
                break
        self.mj.mj_forward(model, data)

    def _moving(self) -> list[int]:
        """Of the velocities, those along x, y and z."""
        first = [int(self.model.body_dofadr[self.model.body(name).id]) for name in self.names]
        return [dof + i for dof in first for i in range(3)]


def _lifted(bodies: Mapping[str, Body], table: TableBox) -> Poses:
    """Where they were measured, and no part below the table's top."""
    found = {}
    for name, body in bodies.items():
        T = body.T_frame_body.copy()
        T[:3, 3] += lift_onto(body, table.up, table.offset) * table.up
        found[name] = T
    return found


def _between(first: Array, last: Array) -> tuple[float, float]:
    """Metres and degrees from one pose (4, 4) to another."""
    turned = rotation_angle(first[:3, :3].T @ last[:3, :3])
    return float(np.linalg.norm(last[:3, 3] - first[:3, 3])), float(np.degrees(turned))


def _within(first: Array, last: Array, metres: float, degrees: float) -> bool:
    moved, turned = _between(first, last)
    return moved < metres and turned < degrees


def _obj(part: Array) -> bytes:
    import trimesh

    hull = trimesh.convex.convex_hull(part)
    text = trimesh.exchange.obj.export_obj(hull, include_normals=False, header=None)
    return str(text).encode()
