"""Objects dropped on a table, one after the other, until they lie still.

Every object collides as the convex hull of its mesh. On a plane this is exact, since a rigid body
touches a plane with its hull only; among objects it is on the safe side: they never pass through
each other, but nothing nests in a bowl or reaches through a handle. A convex decomposition would
let them, for half a minute of work a mesh. In tools/tabletop/stack.py lower objects stay put,
and collide as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tabletop.models import Model
from tabletop.world import World, new_world

TABLE_HALF = 0.75  # metres; the table's top is the square |x|, |y| <= TABLE_HALF at z = 0
TABLE_THICKNESS = 0.1
STEPS_A_SECOND = 240
MARGIN = 1e-4  # Bullet's own 1 mm would leave every object floating 1 mm above the table
DROP_HEIGHT = 0.03
PAUSE = 0.5  # seconds between two drops
SETTLE_LIMIT = 6.0  # seconds
STILL_SPEED, STILL_SPIN = 0.01, 0.2  # m/s, rad/s
DEEPEST = -0.002  # metres; an object pressed deeper into the table is a failure of the simulation


@dataclass(frozen=True)
class Pose:
    """T_world_object of a mesh file: position (3,) metres, orientation (4,) xyzw."""

    position: NDArray[np.float64]
    orientation: NDArray[np.float64]

    def apply(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) of the object, in the world."""
        return points @ rotation(self.orientation).T + self.position


@dataclass(frozen=True)
class Panel:
    """A box that stays where it is: middle (3,), orientation xyzw (4,), half its size (3,), metres,
    world."""

    position: NDArray[np.float64]
    orientation: NDArray[np.float64]
    half: NDArray[np.float64]


TABLE = Panel(
    np.array([0.0, 0.0, -TABLE_THICKNESS / 2]),
    np.array([0.0, 0.0, 0.0, 1.0]),
    np.array([TABLE_HALF, TABLE_HALF, TABLE_THICKNESS / 2]),
)


def rotation(xyzw: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) matrix of a quaternion."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(xyzw).as_matrix(), dtype=np.float64)


def drop(
    models: list[Model],
    rng: np.random.Generator,
    panels: Sequence[Panel] = (),
    radius: float | None = None,
    ground: Panel = TABLE,
) -> list[Pose | None]:
    """Where each model comes to rest; None for one that fell off the table.

    Drawn from `rng`: place and orientation of each drop. All are None if the heap does not come to
    rest or was pressed into the table.

    panels : what stands on the table and stays there; ground : the table, or the floor beneath
    radius : metres; no drop is further from the middle (default: `drop_radius`)
    """
    with new_world() as world:
        world.setGravity(0, 0, -9.81)
        for panel in (ground, *panels):
            add_panel(world, panel)
        bodies: list[int] = []
        radius = drop_radius(models) if radius is None else min(radius, drop_radius(models))
        for model in models:
            bodies.append(_drop_one(world, model, bodies, radius, rng))
            step(world, PAUSE)
        if not come_to_rest(world, bodies):
            return [None] * len(models)
        poses = [_pose(world, body, model) for body, model in zip(bodies, models, strict=True)]
    lowest = [
        float(pose.apply(model.hull + model.center)[:, 2].min())
        for pose, model in zip(poses, models, strict=True)
    ]
    on_table = [
        z > -TABLE_THICKNESS / 2 and float(np.abs(pose.position[:2]).max()) < TABLE_HALF
        for z, pose in zip(lowest, poses, strict=True)
    ]
    if any(on and z < DEEPEST for on, z in zip(on_table, lowest, strict=True)):
        return [None] * len(models)
    return [pose if on else None for pose, on in zip(poses, on_table, strict=True)]


def drop_radius(models: list[Model]) -> float:
    """Radius in metres of a disc with the area of the objects' bounding discs: touching clutter."""
    diameters = np.array([np.linalg.norm(np.ptp(model.hull, axis=0)) for model in models])
    return float(np.clip(0.5 * np.sqrt(np.sum(diameters**2)), 0.05, 0.4 * TABLE_HALF))


def add_panel(world: World, panel: Panel) -> None:
    """A box to drop things on, or against."""
    shape = world.createCollisionShape(world.GEOM_BOX, halfExtents=panel.half.tolist())
    body = world.createMultiBody(
        0,
        shape,
        basePosition=panel.position.tolist(),
        baseOrientation=panel.orientation.tolist(),
    )
    set_contact(world, body)


def set_contact(world: World, body: int) -> None:
    """Friction, damping and collision margin of a body."""
    # Rolling friction stands in for the flat spots and soft skins that stop real fruit and cans.
    world.changeDynamics(
        body,
        -1,
        lateralFriction=0.7,
        rollingFriction=0.002,
        spinningFriction=0.002,
        linearDamping=0.1,
        angularDamping=0.3,
        collisionMargin=MARGIN,
    )


def _drop_one(
    world: World, model: Model, others: list[int], radius: float, rng: np.random.Generator
) -> int:
    from scipy.spatial.transform import Rotation

    orientation = Rotation.from_quat(rng.normal(size=4))  # uniform over all rotations
    turned = orientation.apply(model.hull)
    angle, distance = rng.uniform(0, 2 * np.pi), radius * np.sqrt(rng.uniform())
    x, y = distance * np.cos(angle), distance * np.sin(angle)
    tops = [world.getAABB(body)[1][2] for body in others]
    z = max([0.0, *tops]) + DROP_HEIGHT - float(turned[:, 2].min())
    shape = world.createCollisionShape(world.GEOM_MESH, vertices=model.hull.tolist())
    body = world.createMultiBody(
        model.mass,
        shape,
        basePosition=[x, y, z],
        baseOrientation=orientation.as_quat().tolist(),
    )
    set_contact(world, body)
    return int(body)


def step(world: World, seconds: float) -> None:
    """Simulate so many seconds."""
    for _ in range(round(seconds * STEPS_A_SECOND)):
        world.stepSimulation()


def come_to_rest(world: World, bodies: list[int]) -> bool:
    """Simulate until all that lies on the table lies still; False if it does not in time."""
    for _ in range(round(SETTLE_LIMIT / PAUSE)):
        step(world, PAUSE)
        moving = False
        for body in bodies:
            (_, _, z), _ = world.getBasePositionAndOrientation(body)
            velocity, spin = world.getBaseVelocity(body)
            still = np.linalg.norm(velocity) < STILL_SPEED and np.linalg.norm(spin) < STILL_SPIN
            moving |= not still and z > -TABLE_THICKNESS
        if not moving:
            return True
    return False


def _pose(world: World, body: int, model: Model) -> Pose:
    # The body's frame is its centre of mass; the mesh's origin lies elsewhere.
    position, orientation = map(np.array, world.getBasePositionAndOrientation(body))
    return Pose(position - rotation(orientation) @ model.center, orientation)
