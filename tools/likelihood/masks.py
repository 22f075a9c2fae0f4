"""What speaks for the placements of every mask of made scenes, and whether they are right."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from shown_object import shown_object

from brrp_cli.config import LikelihoodConfig, preset
from brrp_cli.dependencies import import_open3d
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.ground_truth.scenes import Scene, true_mesh_in_camera
from brrp_cli.observation.pixel_noise import pixel_noise
from brrp_cli.observation.ray_samples import observe
from brrp_cli.observation.sensor_noise import wave_deviation
from brrp_cli.observation.strays import without_strays
from brrp_cli.prior.store import Prior
from brrp_cli.raycast import raycasting_scene
from brrp_cli.registration.likelihood import (
    PlacementEvidence,
    depth_ratio,
    evidence,
    misfit,
    see,
)
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis, search
from brrp_cli.registration.refined import refined
from brrp_cli.registration.scale_scan import observed_cloud
from brrp_cli.registration.verification import Verifier, in_waves
from brrp_cli.registration.weigh import counted_once, judged
from brrp_cli.retrieval.base import knows_depth, top_k, unknown
from brrp_cli.retrieval.choose import choose_retriever
from brrp_cli.seeds import child_rng, child_seed
from brrp_cli.segmentation.segment import segment

# Metres, of a placement that is right.
NEAR = 0.005


@dataclass(frozen=True)
class Placed:
    """What speaks for one placement: P(c|R), nats by depth, misfit, votes, and what
    `PlacementEvidence` has; whether its size is another one, and whether it is right."""

    share: float
    depth: float
    misfit: float
    votes: float
    missed: float
    covered: float
    free: float
    unmasked: float
    below: float
    colour: float
    resized: bool
    right: bool


@dataclass(frozen=True)
class Mask:
    """group : name of its set; scene, number : which; missing : P(none that is tried | R);
    aligned : whether P(c|R) knows the depth"""

    group: str
    scene: str
    number: int
    name: str
    pixels: int
    stored: bool
    missing: float
    aligned: bool
    placed: list[Placed]


def collect(
    scene: Scene, group: str, prior: Prior, data_root: Path | None, segmented: bool
) -> list[Mask]:
    """Every mask of the first view of a scene."""
    config = preset("default")
    hypotheses = config.hypotheses
    assert hypotheses is not None
    given = scene.view(0)
    frame = replace(given, segmap=segment(given)) if segmented else given
    retriever = choose_retriever("appearance", prior, config, 0)
    cleaned = without_strays(frame, config.strays)
    seen = observe(cleaned, config.observation, 0)
    noise = pixel_noise(cleaned, seen.plane, hypotheses.sensor)
    wave = wave_deviation(cleaned, seen.plane, hypotheses.sensor)
    hypotheses = replace(hypotheses, search=in_waves(hypotheses.search, wave))
    masks = []
    for number, observation in seen.objects.items():
        mine = frame.segmap == number
        true_id = shown_object(mine, given)
        name = scene.object(true_id).name if true_id else "nothing"
        probabilities = retriever.probabilities(frame, number)
        points = child_rng(0, "testimony", number).permutation(observation.points)
        verifier = Verifier(points.astype(np.float64), cleaned, seen.plane)
        observed = observed_cloud(observation.points, config.features)
        likelihood, sensor = hypotheses.likelihood, hypotheses.sensor
        shown = see(cleaned, number, seen.plane, noise, sensor.patch, sensor.bleed, likelihood)
        found: list[tuple[Hypothesis, float]] = []
        chosen = top_k(probabilities, prior.names, config.k)
        for stored_name, share in chosen:
            best = max((each.alignment_score for each, _ in found), default=-np.inf)
            found_here = search(
                search_model(prior.load(stored_name)),
                observed,
                verifier,
                config.features,
                hypotheses.search,
                child_seed(0, number),
                best,
            )
            found += [(each, share) for each in found_here]
        placements, _ = judged(
            [each for each, _ in found],
            shown,
            counted_once(hypotheses, knows_depth(retriever)),
            lambda each, verifier=verifier: refined(each, verifier, wave, hypotheses),
        )
        best = max((each.alignment_score for each in placements), default=-np.inf)
        near = _nearness(scene, true_id, data_root, given)
        rows = []
        for each, (_, share) in zip(placements, found, strict=True):
            if each.alignment_score < best - likelihood.within:
                continue
            told = evidence(
                each.T_cam_model, each.model, shown, likelihood, hypotheses.search.colour
            )
            resized = bool(abs(np.log(each.scale)) > hypotheses.search.least_size_change)
            right = each.model.stored.name == name and near(each) < NEAR
            rows.append(placed(told, likelihood, share, resized=resized, right=right))
        masks.append(
            Mask(
                group,
                scene.name,
                int(number),
                name,
                int(np.count_nonzero(mine & frame.valid)),
                name in prior.names,
                unknown(np.array([share for _, share in chosen])),
                knows_depth(retriever),
                rows,
            )
        )
    return masks


def placed(
    told: PlacementEvidence,
    likelihood: LikelihoodConfig,
    share: float,
    *,
    resized: bool,
    right: bool,
) -> Placed:
    """What counts of a placement's evidence; `likelihood` : its constants that are not fitted."""
    by_depth = float((told.share * depth_ratio(told, likelihood)).sum())
    return Placed(
        share=float(share),
        depth=by_depth / told.patches_per_vote,
        misfit=misfit(told, likelihood),
        votes=float(told.share.sum() / told.patches_per_vote),
        missed=told.missed,
        covered=told.covered,
        free=told.free,
        unmasked=told.unmasked,
        below=told.below,
        colour=float(told.colour),
        resized=resized,
        right=right,
    )


def _nearness(
    scene: Scene, true_id: int, data_root: Path | None, frame: Frame
) -> Callable[[Hypothesis], float]:
    """Hypothesis -> mean distance, metres, of its surface from that of the true object."""
    if not true_id:
        return lambda each: np.inf
    assert frame.T_world_cam is not None
    mesh = true_mesh_in_camera(scene.object(true_id), data_root, frame.T_world_cam).copy()
    center = mesh.bounds.mean(axis=0)
    mesh.apply_translation(-center)
    cast = raycasting_scene([mesh])

    def near(each: Hypothesis) -> float:
        surface = transform_points(each.T_cam_model, each.model.surface[:1000]) - center
        query = import_open3d().core.Tensor(surface.astype(np.float32))
        return float(cast.compute_distance(query).numpy().mean())

    return near


def as_json(mask: Mask) -> dict[str, Any]:
    """For a line of a file."""
    return {**vars(mask), "placed": [vars(each) for each in mask.placed]}


def read(path: Path) -> list[Mask]:
    """The masks of a file that a run before wrote; none without one."""
    if not path.exists():
        return []
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    return [Mask(**{**row, "placed": [Placed(**each) for each in row["placed"]]}) for row in rows]
