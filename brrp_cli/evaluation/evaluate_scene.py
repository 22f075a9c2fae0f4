"""One scene, in a worker: every variant, every object, one row each."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from brrp_cli.errors import BrrpError
from brrp_cli.evaluation.memory import peak_megabytes, reset_peak
from brrp_cli.evaluation.perturb import shift_masks, with_noise
from brrp_cli.evaluation.pose_error import TruePose, pose_error, true_pose
from brrp_cli.evaluation.recognition import half_extent, recognition
from brrp_cli.evaluation.rows import STAGES, Row, RowLog, variant_columns
from brrp_cli.evaluation.score_object import placement_error, score_probabilities, score_shape
from brrp_cli.evaluation.variants import Variant
from brrp_cli.evaluation.work import Plan, lost_row
from brrp_cli.frames.frame import Frame
from brrp_cli.ground_truth.scenes import Scene
from brrp_cli.ground_truth.surface_metrics import (
    TrueSurface,
    no_surface,
    score_written,
    true_surface,
)
from brrp_cli.ground_truth.true_meshes import close_truth
from brrp_cli.ground_truth.true_shape import TrueShape, true_shape
from brrp_cli.methods.base import Setup
from brrp_cli.methods.registry import METHODS
from brrp_cli.prior.store import Prior, open_prior
from brrp_cli.reconstruction import FAILED, ObjectReconstruction, Reconstruction
from brrp_cli.retrieval.base import unknown
from brrp_cli.retrieval.cached import RememberingRetriever
from brrp_cli.seeds import child_rng

if TYPE_CHECKING:
    from brrp_cli.retrieval.base import Retriever

# Objects with fewer pixels in the mask are not evaluated (published tables).
MIN_PIXELS = 16

# A worker reads the prior and its retrievers once, for all scenes that it is given.
_prior = cache(open_prior)


def evaluate_scene(plan: Plan, scene: Scene, variants: list[Variant], log: Path) -> None:
    """Append the rows of every variant, each variant's as soon as they are known."""
    rows = RowLog(log)
    try:
        clean = scene.view(plan.view)
    except BrrpError as error:
        rows.append(lost_row(scene.name, plan.view, v, str(error)) for v in variants)
        return
    seen = with_noise(clean, child_rng(plan.seed, "noise", scene.name)) if plan.noise else clean
    truths = true_objects(plan, scene, clean)
    memory: dict[str, RememberingRetriever] = {}
    for variant in variants:
        frame = shift_masks(seen, variant.shift)
        found, peak = _reconstruct(plan, scene, frame, variant, memory)
        rows.append(
            _row(plan, scene, variant, clean, object_id, truths, found, memory, peak)
            for object_id in truths
        )
        if plan.pictures is not None:
            _draw(plan.pictures, scene, frame, variant, found)


class Truth(NamedTuple):
    """One true object: occupancy on grids and its surface, camera frame; `half_extent`: half the
    longest side of its box along its own axes, metres; where its mesh lies."""

    shape: TrueShape
    surface: TrueSurface
    half_extent: float
    pose: TruePose


def true_objects(plan: Plan, scene: Scene, clean: Frame) -> dict[int, Truth | BrrpError]:
    """The truth of each object with enough pixels, or why there is none; by id."""
    assert clean.T_world_cam is not None
    truths: dict[int, Truth | BrrpError] = {}
    for object_id in clean.object_ids:
        if np.count_nonzero(clean.segmap == object_id) < MIN_PIXELS:
            continue
        rng = child_rng(plan.seed, "truth", scene.name, object_id)
        try:
            true_object = scene.object(object_id)
            meshes = close_truth(true_object, plan.data_root, plan.cache)
            shape = true_shape(meshes, clean, rng)
            surface = true_surface(shape.mesh.measured, clean, object_id, scene.name, plan.seed)
            size = half_extent(meshes.exact.vertices, true_object.T_world_object)
            pose = true_pose(true_object, meshes.exact.vertices, clean.T_world_cam)
            truths[object_id] = Truth(shape, surface, size, pose)
        except BrrpError as error:
            truths[object_id] = error
    return truths


def _reconstruct(
    plan: Plan,
    scene: Scene,
    frame: Frame,
    variant: Variant,
    memory: dict[str, RememberingRetriever],
) -> tuple[dict[int, ObjectReconstruction] | BrrpError, float]:
    """What the method found, by id, and the peak of memory in MB."""
    method = METHODS[variant.method]
    prior, retriever = None, None
    reset_peak()
    try:
        if method.uses_prior:
            assert plan.prior is not None
            prior = _prior(plan.prior)
        if prior is not None and method.uses_retriever:
            key = _memory_key(variant)
            if key not in memory:
                memory[key] = RememberingRetriever(_retriever(plan, scene, variant, prior))
            retriever = memory[key]
        setup = Setup(
            config=variant.config,
            seed=plan.seed,
            device=plan.device if method.uses_cuda else "cpu",
            prior=prior,
            retriever=retriever,
            # Those that the method brings are not in the plan.
            weights=plan.weights.get(variant.weights) if variant.weights else None,
            # Scenes are shared out among processes.
            workers=1,
        )
        found = method.run(frame, setup)
    except BrrpError as error:
        return error, peak_megabytes()
    return _by_id(found), peak_megabytes()


def _by_id(found: Reconstruction) -> dict[int, ObjectReconstruction]:
    """The objects, each with its equal share of the time of stages that concern the whole frame."""
    share = {
        stage: found.seconds[stage] / len(found.objects)
        for stage in STAGES
        if stage in found.seconds and found.objects
    }
    return {
        item.object_id: replace(item, seconds={**share, **item.seconds}) for item in found.objects
    }


def _memory_key(variant: Variant) -> str:
    """Equal for variants that show the same frame to the same retriever."""
    return f"{variant.shift} {variant.retrieval_key}"


def _retriever(plan: Plan, scene: Scene, variant: Variant, prior: Prior) -> Retriever:
    from brrp_cli.retrieval.given import TruthRetriever

    assert variant.retriever is not None and plan.prior is not None
    if variant.retriever == "truth":
        return TruthRetriever(prior.names, {o.id: o.name for o in scene.objects})
    return _found_retriever(variant.retriever, plan.prior, variant.config, plan.seed, plan.clip_dir)


@cache
def _found_retriever(
    name: str, prior: Path, config: Any, seed: int, clip_dir: Path | None
) -> Retriever:
    from brrp_cli.retrieval.choose import choose_retriever

    return choose_retriever(name, _prior(prior), config, seed, clip_dir=clip_dir)


def _row(
    plan: Plan,
    scene: Scene,
    variant: Variant,
    clean: Frame,
    object_id: int,
    truths: dict[int, Truth | BrrpError],
    found: dict[int, ObjectReconstruction] | BrrpError,
    memory: dict[str, RememberingRetriever],
    peak: float,
) -> Row:
    row: Row = {
        "scene": scene.name,
        "view": plan.view,
        "object_id": object_id,
        "name": scene.object(object_id).name,
        "visible_pixels": int(np.count_nonzero(clean.segmap == object_id)),
        "objects_in_view": len(truths),
        **variant_columns(variant),
        "peak_memory_mb": peak,
    }
    truth = truths[object_id]
    if not isinstance(truth, BrrpError):
        surface = truth.surface
        row |= {"thickness": surface.thickness, "thickness_class": surface.thickness_class}
        # What fails has no mesh, which counts.
        row |= no_surface() if METHODS[variant.method].gives_shapes else {}
    if isinstance(found, BrrpError):
        return {**row, "status": FAILED, "message": str(found)}
    item = found.get(object_id)
    if item is None:
        return {**row, "status": FAILED, "message": "not in the masks that the method was shown"}
    row |= {"status": item.status, "message": item.message, "points": item.n_points}
    row |= _seconds(item, memory.get(_memory_key(variant)))
    retriever = memory.get(_memory_key(variant))
    if METHODS[variant.method].uses_retriever and retriever is not None and plan.prior is not None:
        row |= _retrieval(_prior(plan.prior).names, retriever, row["name"], item)
    if isinstance(truth, BrrpError):
        return {**row, "status": FAILED, "message": str(truth)}
    if item.surface is not None:
        mesh = item.surface.as_trimesh()
        row |= score_written(mesh, truth.surface, scene.name, plan.seed)
    if item.posterior is not None:
        rng = child_rng(plan.seed, "score", scene.name, object_id)
        scores, diagrams = score_probabilities(item.posterior, truth.shape)
        level = variant.config.surface.level
        shape = score_shape(item.posterior, truth.shape, rng, level)
        row |= {**shape, **scores, "diagrams": diagrams}
    if plan.prior is not None:
        in_prior = row["name"] in _prior(plan.prior).names
        row |= recognition(item, row["name"], in_prior, truth.half_extent)
    placed = [r for r in item.retrieved if r.T_cam_object is not None]
    if placed and plan.prior is not None:
        # Without weights, the most probable.
        best = max(placed, key=lambda each: each.weight or 0.0)
        stored = _prior(plan.prior).load(best.name)
        row["placement_error"] = placement_error(best, stored, truth.shape)
        if row.get("recognised"):
            row |= pose_error(best, stored, truth.pose)
    return row


def _seconds(item: ObjectReconstruction, retriever: RememberingRetriever | None) -> dict[str, Any]:
    """Seconds of each stage; remembered answers count as long as the first ones took, each object
    an equal share of them."""
    seconds = dict(item.seconds)
    if retriever is not None and item.object_id in retriever.seconds:
        seconds["retrieval"] = sum(retriever.seconds.values()) / len(retriever.seconds)
    stages = {f"seconds_{s}": round(seconds[s], 4) for s in STAGES if s in seconds}
    return {**stages, "seconds_total": round(sum(seconds.values()), 4)}


def _retrieval(
    names: list[str], retriever: RememberingRetriever, true_name: str, item: ObjectReconstruction
) -> Row:
    """Where the true object came; its rank is 1 where no other is more probable."""
    row: Row = {
        "in_prior": true_name in names,
        "placed": sum(r.T_cam_object is not None for r in item.retrieved),
    }
    answer = retriever.answers.get(item.object_id)
    if answer is not None:
        row["not_in_prior"] = unknown(answer)
        best = int(np.argmax(answer))
        row |= {"best": names[best], "best_probability": float(answer[best])}
    if true_name in names and answer is not None:
        mine = float(answer[names.index(true_name)])
        row |= {"true_rank": 1 + int(np.sum(answer > mine)), "true_probability": mine}
    return row


def _draw(
    folder: Path,
    scene: Scene,
    frame: Frame,
    variant: Variant,
    found: dict[int, ObjectReconstruction] | BrrpError,
) -> None:
    from brrp_cli.evaluation.pictures import write_picture

    if not isinstance(found, BrrpError):
        name = "_".join([scene.name, *variant.label.replace("=", "").split()])
        write_picture(folder / f"{name}.png", frame, list(found.values()), variant)
