"""Objects set on and into one another: every second one is dropped onto the one before it.

The lower one stands as it would rest on the table, open side up where it has one, and collides as
the mesh that it is, so that things come to lie inside bowls and boxes. The upper one collides as
its convex hull. What slides off stays where it comes to rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.raycast import raycasting_scene
from tabletop.models import Model
from tabletop.settle import (
    DROP_HEIGHT,
    TABLE,
    TABLE_HALF,
    Pose,
    add_panel,
    come_to_rest,
    rotation,
    set_contact,
    step,
)
from tabletop.world import World, new_world

HOLLOW = 0.025  # metres from the rim down to what a plumb line meets inside an open thing
LIKELY = 0.05  # least probability of a resting pose
APART = 0.02  # metres between the circles around two lower ones
TRIES = 300
FACES, CORNERS = 400, 100  # of what collides
PAUSE = 1.0  # seconds between two drops


@dataclass(frozen=True)
class Resting:
    """A way to stand on the table: orientation xyzw (4,); `hollow` metres from the rim down."""

    orientation: NDArray[np.float64]
    probability: float
    hollow: float


def stack(models: list[Model], rng: np.random.Generator) -> list[Pose | None]:
    """Where each model comes to rest; None for one without a place or one that fell off the table.

    All are None if something keeps moving.
    """
    from scipy.spatial.transform import Rotation

    lower, upper = models[0::2], models[1::2]
    poses: list[Pose | None] = [None] * len(models)
    with new_world() as world:
        world.setGravity(0, 0, -9.81)
        add_panel(world, TABLE)
        spots: list[tuple[NDArray[np.float64], float]] = []
        bodies: dict[int, int] = {}
        for number, model in enumerate(lower):
            turn = Rotation.from_euler("z", rng.uniform(0, 2 * np.pi))
            turned = (turn * Rotation.from_quat(standing(model, rng).orientation)).as_quat()
            pose = _place(model, turned, spots, len(lower), rng)
            if pose is None:
                continue
            poses[2 * number] = pose
            body = _add_fixed(world, model, pose)
            if 2 * number + 1 >= len(models):
                continue
            top = world.getAABB(body)[1][2]
            bodies[2 * number + 1] = _drop_on(world, upper[number], spots[-1][0], top, rng)
            step(world, PAUSE)
        if not come_to_rest(world, list(bodies.values())):
            return [None] * len(models)
        for number, body in bodies.items():
            position, orientation = map(np.array, world.getBasePositionAndOrientation(body))
            pose = Pose(position - rotation(orientation) @ models[number].center, orientation)
            on_table = position[2] > 0 and float(np.abs(position[:2]).max()) < TABLE_HALF
            poses[number] = pose if on_table else None
    return poses


def standing(model: Model, rng: np.random.Generator) -> Resting:
    """A likely way to rest on the table: with the open side up where there is one."""
    ways = resting(model)
    hollow = [way for way in ways if way.hollow > HOLLOW]
    if hollow:
        return max(hollow, key=lambda way: way.probability)
    share = np.array([way.probability for way in ways])
    return ways[int(rng.choice(len(ways), p=share / share.sum()))]


def resting(model: Model) -> list[Resting]:
    """The ways in which a model rests on a plane, and how deep its inside is in each."""
    import trimesh
    from scipy.spatial.transform import Rotation

    hull = trimesh.convex.convex_hull(model.hull)
    transforms, probabilities = trimesh.poses.compute_stable_poses(hull, threshold=LIKELY)
    if len(transforms) == 0:
        transforms, probabilities = np.eye(4)[None], np.ones(1)
    mesh = trimesh.Trimesh(model.vertices - model.center, model.faces, process=False)
    scene = raycasting_scene([mesh])
    o3d = import_open3d()
    ways = []
    for transform, probability in zip(transforms, probabilities, strict=True):
        R = transform[:3, :3]
        height = model.hull @ R.T
        top, middle = height[:, 2].max(), (height.min(axis=0) + height.max(axis=0)) / 2
        start = np.array([middle[0], middle[1], top + 0.01])
        ray = np.concatenate([R.T @ start, R.T @ [0.0, 0.0, -1.0]]).astype(np.float32)
        hit = float(scene.cast_rays(o3d.core.Tensor(ray[None]))["t_hit"].numpy()[0])
        # A hole right through, as of a ring, holds nothing.
        hollow = hit - 0.01 if np.isfinite(hit) else 0.0
        quaternion = np.asarray(Rotation.from_matrix(R).as_quat(), dtype=np.float64)
        ways.append(Resting(quaternion, float(probability), hollow))
    return ways


def _place(
    model: Model,
    orientation: NDArray[np.float64],
    spots: list[tuple[NDArray[np.float64], float]],
    count: int,
    rng: np.random.Generator,
) -> Pose | None:
    """Upright on the table and clear of the others; `spots` gains its own."""
    R = rotation(orientation)
    hull = model.hull @ R.T
    radius = float(np.linalg.norm(hull[:, :2], axis=1).max())
    for _ in range(TRIES):
        spot = rng.uniform(-1, 1, 2) * min(0.12 + 0.03 * count, 0.4)
        if all(np.linalg.norm(spot - other) > radius + r + APART for other, r in spots):
            spots.append((spot, radius))
            center = np.array([*spot, -hull[:, 2].min()])
            return Pose(center - R @ model.center, orientation)
    return None


def _add_fixed(world: World, model: Model, pose: Pose) -> int:
    o3d = import_open3d()
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(model.vertices), o3d.utility.Vector3iVector(model.faces)
    )
    # Of thousands of triangles every step of the simulation takes a second.
    mesh = mesh.remove_duplicated_vertices().simplify_quadric_decimation(FACES)
    shape = world.createCollisionShape(
        world.GEOM_MESH,
        vertices=np.asarray(mesh.vertices).tolist(),
        indices=np.asarray(mesh.triangles).ravel().tolist(),
        flags=world.GEOM_FORCE_CONCAVE_TRIMESH,
    )
    body = world.createMultiBody(
        0, shape, basePosition=pose.position.tolist(), baseOrientation=pose.orientation.tolist()
    )
    set_contact(world, body)
    return int(body)


def _drop_on(
    world: World, model: Model, spot: NDArray[np.float64], top: float, rng: np.random.Generator
) -> int:
    """The model right above the middle of `spot`, as it would rest, and a little aside."""
    from scipy.spatial.transform import Rotation

    ways = resting(model)
    share = np.array([way.probability for way in ways])
    way = ways[int(rng.choice(len(ways), p=share / share.sum()))]
    turn = Rotation.from_euler("z", rng.uniform(0, 2 * np.pi))
    orientation = turn * Rotation.from_quat(way.orientation)
    z = top + DROP_HEIGHT / 3 - float(orientation.apply(model.hull)[:, 2].min())
    corners = model.hull[:: -(-len(model.hull) // CORNERS)]
    shape = world.createCollisionShape(world.GEOM_MESH, vertices=corners.tolist())
    body = world.createMultiBody(
        model.mass,
        shape,
        basePosition=[*(spot + rng.uniform(-0.01, 0.01, 2)), z],
        baseOrientation=orientation.as_quat().tolist(),
    )
    set_contact(world, body)
    return int(body)
