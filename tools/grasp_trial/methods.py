"""What a planner is told of a scene: by a reconstruction, by what was seen alone, by the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from brrp_cli.api import reconstruct
from brrp_cli.config import SurfaceConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.scene import GraspObject, GraspScene, scene_of
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.store import Prior
from brrp_cli.retrieval.base import Retriever
from grasp_trial.bodies import TrueBody

DEFAULT, MEAN, VPRISM, SEEN, TRUTH = "default", "mean mesh", "vprism", "seen hull", "true mesh"
METHODS = (DEFAULT, MEAN, VPRISM, SEEN, TRUTH)
# Only where it is asked for.
POINTSDF = "pointsdf"
# Fewer points have no hull worth the name.
FEWEST = 16


def scenes_of(
    methods: Sequence[str],
    frame: Frame,
    bodies: Sequence[TrueBody],
    prior: Prior | None,
    retriever: Retriever | None,
    seed: int,
    weights: Path | None = None,
) -> dict[str, GraspScene]:
    """By method: `default` with its posterior; `mean mesh`, the same meshes without; meshes of
    V-PRISM and PointSDF; the convex hull of the points that are seen; the true meshes."""
    assert frame.T_world_cam is not None
    plane = _table(frame)
    found = {}
    if DEFAULT in methods or MEAN in methods:
        result = reconstruct(frame, prior, retriever=retriever, seed=seed, workers=1)
        found[DEFAULT] = scene_of(result)
        found[MEAN] = _without_posteriors(found[DEFAULT])
    for other in {VPRISM, POINTSDF} & set(methods):
        given = weights if other == POINTSDF else None
        guess = reconstruct(frame, method=other, weights=given, seed=seed, workers=1)
        found[other] = _without_posteriors(scene_of(guess))
    T_cam_world = np.linalg.inv(frame.T_world_cam)
    if SEEN in methods:
        seen = {i: frame.object_points(i) for i in frame.object_ids}
        hulls = [_hull(i, points) for i, points in seen.items() if len(points) >= FEWEST]
        found[SEEN] = _scene([each for each in hulls if each is not None], plane)
    if TRUTH in methods:
        found[TRUTH] = _scene(
            [_true(b, T_cam_world @ b.T_world_object, frame) for b in bodies], plane
        )
    return {method: found[method] for method in methods}


def _scene(objects: list[GraspObject], plane: Plane) -> GraspScene:
    return GraspScene(objects, plane, {}, np.zeros((0, 3)), SurfaceConfig())


def _without_posteriors(scene: GraspScene) -> GraspScene:
    return replace(scene, objects=[replace(each, posterior=None) for each in scene.objects])


def _true(body: TrueBody, T_cam_object: np.ndarray, frame: Frame) -> GraspObject:
    vertices = transform_points(T_cam_object, np.asarray(body.mesh.vertices))
    faces = np.asarray(body.mesh.faces, dtype=np.int64)
    seen = frame.object_points(body.object_id)
    return GraspObject(body.object_id, np.asarray(vertices, dtype=np.float64), faces, seen, None)


def _hull(object_id: int, points: np.ndarray) -> GraspObject | None:
    import trimesh

    hull = trimesh.convex.convex_hull(points.astype(np.float64))
    if hull.volume <= 0:
        return None
    faces = np.asarray(hull.faces, dtype=np.int64)
    return GraspObject(object_id, np.asarray(hull.vertices), faces, points, None)


def _table(frame: Frame) -> Plane:
    """The true table, z = 0 of the world, in the camera frame."""
    assert frame.T_world_cam is not None
    T_cam_world = np.linalg.inv(frame.T_world_cam)
    normal = T_cam_world[:3, 2]
    return Plane(normal, float(-normal @ T_cam_world[:3, 3]))
