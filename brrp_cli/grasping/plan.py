"""Ranked grasps of every object of a scene.

from brrp_cli import open_result, plan_grasps
best = plan_grasps(open_result("out/"), "franka-hand").grasps[0]
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.grasping import GraspConfig
from brrp_cli.errors import BrrpError
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.candidates import Poses, antipodal_pairs, comes_from, hand_poses, lifted_off
from brrp_cli.grasping.closing import Closed, close_on
from brrp_cli.grasping.draws import Mesh, SurfaceDraws, draw_surfaces, mesh_alone, wall_mesh
from brrp_cli.grasping.grasp import Grasp, GraspPlan, ObjectGrasps, worth
from brrp_cli.grasping.gripper import Gripper
from brrp_cli.grasping.gripper_file import DEFAULT, open_gripper
from brrp_cli.grasping.obstacles import Obstacles
from brrp_cli.grasping.options import ALL, APPROACHES, CONE, MIN_SCORE, PER_OBJECT, TOP_DOWN
from brrp_cli.grasping.quality import carries, quality
from brrp_cli.grasping.scene import GraspObject, GraspScene, scene_of
from brrp_cli.observation.support_plane import Plane
from brrp_cli.reconstruction import Reconstruction
from brrp_cli.results.read import StoredResult
from brrp_cli.seeds import child_rng
from brrp_cli.spoken import option
from brrp_cli.surface.confidence import confidence_surface
from brrp_cli.threads import cores, in_threads

Array = NDArray[np.float64]


def plan_grasps(
    result: Reconstruction | StoredResult | GraspScene,
    gripper: Gripper | str | Path = DEFAULT,
    *,
    config: GraspConfig | None = None,
    approach: str = ALL,
    per_object: int = PER_OBJECT,
    min_score: float = MIN_SCORE,
    seed: int = 0,
    workers: int | None = None,
) -> GraspPlan:
    """Ranked grasps of each object that has a mesh.

    gripper : one that is described, a name that comes with brrp, or a YAML file
    approach : "all"; "top-down" or "cone", within `config.top_down` or `config.cone` degrees of
    straight down; min_score : grasps that hold less probably are left out

    The same seed gives the same grasps, whatever the number of workers. Errors: GripperError;
    ResultError where no object has a mesh; DependencyError without python-fcl.
    """
    if approach not in APPROACHES:
        raise BrrpError("No such approach", found=approach, expected=", ".join(APPROACHES))
    config = GraspConfig() if config is None else config
    hand = gripper if isinstance(gripper, Gripper) else open_gripper(gripper)
    scene = result if isinstance(result, GraspScene) else scene_of(result, config)
    workers = cores() if workers is None else workers
    # Here, as threads do not know whether it was typed on a command line.
    asked = option("min_score", f"{min_score:g}")

    def shape(item: GraspObject) -> Mesh:
        return collision_shape(item, scene, config)

    shapes = [*in_threads(shape, scene.objects, workers), *map(wall_mesh, scene.solids)]
    planned = [
        _Task(item, i, scene, shapes, hand, config, approach, per_object, min_score, asked, seed)
        for i, item in enumerate(scene.objects)
    ]
    found = list(in_threads(_plan_object, planned, workers))
    found += [ObjectGrasps(i, [], why=f"it has no mesh: {w}") for i, w in scene.without.items()]
    found.sort(key=lambda each: each.object_id)
    return GraspPlan(found, hand, config, approach, min_score, per_object, seed)


def collision_shape(item: GraspObject, scene: GraspScene, config: GraspConfig) -> Mesh:
    """What a hand keeps out of where it is not to touch an object: what holds the object with the
    configured probability, or its mesh."""
    own = Mesh(item.vertices, item.faces)
    if item.posterior is None or config.confidence == 0:
        return own
    surface = replace(
        scene.surface,
        around_nodes=config.neighbour_nodes,
        alike_vertices=config.neighbour_vertices,
    )
    found = confidence_surface(
        item.posterior, item.observed, min(config.confidence, 0.999), surface
    )
    return own if found is None else Mesh(found.vertices, found.faces)


@dataclass(frozen=True)
class _Task:
    """One object of a scene, the `number`-th, and the shapes of all, then of walls; `asked` is how
    a message names `min_score`."""

    item: GraspObject
    number: int
    scene: GraspScene
    shapes: list[Mesh]
    gripper: Gripper
    config: GraspConfig
    approach: str
    per_object: int
    min_score: float
    asked: str
    seed: int


def _plan_object(task: _Task) -> ObjectGrasps:
    item, scene, config, gripper = task.item, task.scene, task.config, task.gripper
    rng = child_rng(task.seed, "grasp", item.object_id)
    own = Mesh(item.vertices, item.faces)
    surfaces = draw_surfaces(item, own, config, scene.surface, rng)
    pairs, fell = _pairs(own, surfaces, gripper, config, rng)
    poses = hand_poses(pairs, scene.up, gripper, config)
    steepest = {ALL: 90 + config.steepest, TOP_DOWN: config.top_down, CONE: config.cone}
    if task.approach != ALL or scene.plane is not None:
        poses = _kept(
            poses, comes_from(poses.T, scene.up, steepest[task.approach]), fell, "approach"
        )
    poses, clear = lifted_off(poses, scene.plane, gripper, config)
    poses = _kept(poses, clear, fell, "table")
    others = [shape for i, shape in enumerate(task.shapes) if i != task.number]
    obstacles = Obstacles(others, _some(scene.loose, config.loose), scene.hidden)
    hit = obstacles.probably_hits(poses.T, poses.openings, gripper, config)
    poses = _kept(poses, ~hit, fell, "neighbour")
    poses = _most_promising(item, own, poses, gripper, config, fell)
    off = _misplacements(config, rng)
    closed = close_on(surfaces, poses.T, poses.openings, gripper, config, off)
    low = _on_the_table(poses, off, scene.plane, gripper)
    return _ranked(task, poses, closed, low, obstacles, fell)


def _pairs(
    own: Mesh,
    surfaces: SurfaceDraws,
    gripper: Gripper,
    config: GraspConfig,
    rng: np.random.Generator,
) -> tuple[Array, dict[str, int]]:
    """Antipodal pairs (n, 2, 3), `config.pairs` at most, of the mesh and of some drawn surfaces,
    and how many points have no partner."""
    drawn = round(config.points * config.sampled_share)
    some = np.linspace(0, len(surfaces), config.sampled, endpoint=False).astype(np.int64)
    both = [
        antipodal_pairs(mesh_alone(own), config.points - drawn, gripper, config, rng),
        antipodal_pairs(surfaces.only(some), drawn, gripper, config, rng),
    ]
    every = np.concatenate([each.points for each in both])
    fell = {
        "points": sum(each.tried for each in both),
        "too_wide": sum(each.too_wide for each in both),
        "not_antipodal": sum(each.not_antipodal for each in both),
    }
    return rng.permutation(every)[: config.pairs], fell


def _kept(poses: Poses, good: NDArray[np.bool_], fell: dict[str, int], why: str) -> Poses:
    fell[why] = fell.get(why, 0) + int((~good).sum())
    return poses.take(good)


def _most_promising(
    item: GraspObject,
    own: Mesh,
    poses: Poses,
    gripper: Gripper,
    config: GraspConfig,
    fell: dict[str, int],
) -> Poses:
    """`config.candidates` poses at most: those that hold the mesh itself first, of each family the
    deepest of them, and what holds it best before the rest."""
    if not len(poses):
        return poses
    closed = close_on(mesh_alone(own), poses.T, poses.openings, gripper, config)
    holds = closed.holds[0]
    good = quality(poses, closed, item, config)
    # Deepest of those that may hold, in each family; if none does, the deepest.
    rank = np.lexsort([poses.order, holds == 0, poses.family])
    first = np.unique(poses.family[rank], return_index=True)[1]
    best = rank[first]
    order = np.lexsort([-good[best], -holds[best]])
    chosen = best[order][: config.candidates]
    fell["not_tried"] = len(poses) - len(chosen)
    return poses.take(chosen)


def _misplacements(config: GraspConfig, rng: np.random.Generator) -> Array:
    """(S, 4, 4), in its own frame, where the hand gets to in each draw."""
    from scipy.spatial.transform import Rotation

    T = np.repeat(np.eye(4)[None], config.draws, axis=0)
    turn = rng.normal(0, np.deg2rad(config.accuracy_angle), (config.draws, 3))
    T[:, :3, :3] = Rotation.from_rotvec(turn).as_matrix()
    T[:, :3, 3] = rng.normal(0, config.accuracy, (config.draws, 3))
    return T


def _on_the_table(
    poses: Poses, off: Array, plane: Plane | None, gripper: Gripper
) -> NDArray[np.bool_]:
    """(S, n): whether each hand touches the table where it gets to in each draw."""
    low = np.zeros((len(off), len(poses)), dtype=bool)
    if plane is not None and len(poses):
        for draw, move in enumerate(off):
            low[draw] = gripper.lowest(poses.T @ move, poses.openings, plane) < 0
    return low


def _ranked(
    task: _Task,
    poses: Poses,
    closed: Closed,
    low: NDArray[np.bool_],
    obstacles: Obstacles,
    fell: dict[str, int],
) -> ObjectGrasps:
    """The best grasps that are far enough from each other and that no neighbour is in the way of,
    exactly."""
    config, item = task.config, task.item
    held = (closed.holds * ~low).mean(axis=0)
    score = held * carries(poses, closed, item, config)
    good = quality(poses, closed, item, config)
    enough = score >= max(task.min_score, 1e-9)
    causes = {
        "object": closed.collides.mean(axis=0),
        "missed": closed.misses.mean(axis=0),
        "friction": closed.slips.mean(axis=0),
        "table": low.mean(axis=0),
        "weight": held - score,
    }
    worst = np.stack([*causes.values()]).argmax(axis=0)
    for i, why in enumerate(causes):
        fell[why] = fell.get(why, 0) + int((~enough & (worst == i)).sum())
    fell |= {"similar": 0, "more": 0}
    grasps: list[Grasp] = []
    for i in np.argsort(-worth(score, good, config), kind="stable"):
        if not enough[i]:
            continue
        if len(grasps) == task.per_object:
            fell["more"] += 1
        elif any(_similar(poses.T[i], each.T_cam_gripper, task) for each in grasps):
            fell["similar"] += 1
        elif obstacles.hits(poses.T[i], float(poses.openings[i]), task.gripper, config):
            fell["neighbour"] += 1
        else:
            grasps.append(_grasp(item, poses, closed, int(i), float(score[i]), float(good[i])))
    if grasps:
        return ObjectGrasps(item.object_id, grasps, fell)
    below = _best_below(task, poses, score, obstacles)
    why = why_below(below, task.asked, fell) if below else why_none(fell)
    return ObjectGrasps(item.object_id, [], fell, why)


def _best_below(task: _Task, poses: Poses, score: Array, obstacles: Obstacles) -> float:
    """The score of the best grasp that is worth a word, that `min_score` alone left out; 0 where
    there is none."""
    left = np.flatnonzero((score >= WORTH_A_WORD) & (score < task.min_score))
    for i in left[np.argsort(-score[left], kind="stable")]:
        if not obstacles.hits(poses.T[i], float(poses.openings[i]), task.gripper, task.config):
            return float(score[i])
    return 0.0


def _grasp(
    item: GraspObject, poses: Poses, closed: Closed, i: int, score: float, good: float
) -> Grasp:
    held = closed.holds[:, i] > 0
    local = np.median(closed.contacts[held, i], axis=0)
    return Grasp(
        item.object_id,
        poses.T[i],
        float(poses.openings[i]),
        float(local[1, 0] - local[0, 0]),
        score,
        good,
        np.asarray(transform_points(poses.T[i], local), dtype=np.float64),
    )


def _similar(T: Array, other: Array, task: _Task) -> bool:
    """Whether two hands do the same: a turn by half around the approach changes nothing."""
    tip = np.array([0, 0, task.gripper.tip])
    moved = np.linalg.norm(transform_points(T, tip) - transform_points(other, tip))
    limit = np.cos(np.deg2rad(task.config.apart_angle))
    return bool(
        moved < task.config.apart
        and T[:3, 2] @ other[:3, 2] > limit
        and abs(T[:3, 0] @ other[:3, 0]) > limit
    )


REASONS = {
    "too_wide": "no two sides of it face each other within the hand's opening",
    "not_antipodal": "no two of its sides face each other within the friction cone",
    "approach": "every approach comes from a forbidden side",
    "table": "the hand would touch the table",
    "neighbour": "the hand would touch a neighbour",
    "object": "the hand would run into the object before it closes",
    "missed": "a finger would meet nothing",
    "friction": "it would slip out",
    "weight": "its weight would turn it in the hand",
}
WORTH_A_WORD, MOSTLY = 0.01, 0.5  # scores: what is called a grasp, and one that holds mostly
NOWHERE = "its posterior has no surface to take hold of"


def why_none(fell: dict[str, int]) -> str:
    """The last reason for which candidates fell, of those that most did for."""
    last = [key for key in ("object", "missed", "friction", "weight") if fell.get(key)]
    middle = [key for key in ("neighbour", "table", "approach") if fell.get(key)]
    early = [key for key in ("too_wide", "not_antipodal") if fell.get(key)]
    for group in (last, middle, early):
        if group:
            return REASONS[max(group, key=lambda key: fell[key])]
    return NOWHERE


def why_below(best: float, asked: str, fell: dict[str, int]) -> str:
    """That the best grasp does not hold as probably as was asked for; where it mostly does not hold
    at all, also why not."""
    shown = math.floor(best * 100) / 100  # 0.9599 is not told as 0.96 where 0.96 was asked for
    text = f"its best grasp holds with probability {shown:.2f}, less than {asked}"
    return text if best >= MOSTLY else f"{text}: mostly {why_none(fell)}"


def _some(points: Array, most: int) -> Array:
    return points[:: max(1, -(-len(points) // most))]
