"""BRRP by hypotheses: retrieve, place in many ways, verify, weigh, infer (the default preset)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.completion.visible_part import visible_part
from brrp_cli.config import Config, HypothesesConfig, MeanConfig, WeighConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.infer import LabelledPoints
from brrp_cli.inference.infer_hypotheses import Problem, infer_correction, systematic_resampling
from brrp_cli.inference.prior_mean import (
    PriorMeanGrid,
    completed_grid,
    empty_space,
    grid_over,
    shape_logits,
)
from brrp_cli.observation.ray_samples import ObjectObservation
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import OK, ObjectReconstruction, Retrieved
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis, search
from brrp_cli.registration.scale_scan import observed_cloud
from brrp_cli.registration.verification import Verifier
from brrp_cli.retrieval.base import Retriever, top_k, unknown
from brrp_cli.seeds import child_rng, child_seed
from brrp_cli.timing import timed

Array = NDArray[np.float64]


def reconstruct_by_hypotheses(
    frame: Frame,
    plane: Plane | None,
    observation: ObjectObservation,
    prior: Prior,
    retriever: Retriever,
    config: Config,
    *,
    seed: int,
    device: str,
) -> ObjectReconstruction:
    """Posterior of one object from hypotheses about the k retrieved objects and from the one that
    it is none of them, each corrected by what was observed."""
    hypotheses = config.hypotheses
    assert hypotheses is not None
    seconds: dict[str, float] = {}
    object_id = observation.object_id
    with timed(seconds, "retrieval"):
        probabilities = retriever.probabilities(frame, object_id)
        chosen = top_k(probabilities, prior.names, config.k)
        missing = unknown(probabilities)
    with timed(seconds, "registration"):
        verifier = Verifier(_shuffled(observation.points, seed, object_id), frame, plane)
        observed = observed_cloud(observation.points, config.features)
        found: list[list[Hypothesis]] = []
        for name, _ in chosen:
            found.append(
                search(
                    search_model(prior.load(name)),
                    observed,
                    verifier,
                    config.features,
                    hypotheses.search,
                    child_seed(seed, object_id),
                    max(
                        (each.alignment_score for group in found for each in group), default=-np.inf
                    ),
                )
            )
    with timed(seconds, "inference"):
        placed = [each for group in found for each in group]
        shares = [p for (_, p), group in zip(chosen, found, strict=True) for _ in group]
        weights = weigh(
            shares, [each.alignment_score for each in placed], missing, hypotheses.weigh
        )
        posterior = _infer(
            observation, frame, plane, placed, weights, hypotheses, seed=seed, device=device
        )
    ends = np.cumsum([0, *(len(group) for group in found)])
    return ObjectReconstruction(
        object_id=object_id,
        status=OK,
        n_points=len(observation.points),
        center=observation.center,
        observed=observation.points,
        retrieved=[
            _retrieved(name, probability, group, float(weights[a:b].sum()))
            for (name, probability), group, a, b in zip(
                chosen, found, ends[:-1], ends[1:], strict=True
            )
        ],
        unknown_probability=missing,
        unknown_weight=float(weights[-1]),
        posterior=posterior,
        seconds=seconds,
    )


def weigh(
    shares: Sequence[float], alignment_score: Sequence[float], missing: float, config: WeighConfig
) -> Array:
    """Weights (C + 1,), sum 1, of C hypotheses and, last, of the one that it is something else.

    shares : P(c|R) of each hypothesis's object; missing : P(not in the prior | R).
    """
    none = float(np.clip(missing, config.least_unknown, config.most_unknown))
    known = np.asarray(shares, dtype=np.float64)
    # Ratios among the stored objects are the retriever's, how likely they are as a whole is not:
    # alignment score that stands above all doubt outweighs a retriever that was wrong.
    if not known.any():
        known = np.ones_like(known)
    probability = np.append(known / (known.sum() or 1.0) * (1 - none), none)
    scores = np.append(np.asarray(alignment_score, dtype=np.float64), config.unknown_score)
    log = np.log(np.maximum(probability, config.least_share)) + config.sharpness * scores
    weights = np.exp(log - log.max())
    return np.asarray(weights / weights.sum())


def _infer(
    observation: ObjectObservation,
    frame: Frame,
    plane: Plane | None,
    placed: list[Hypothesis],
    weights: Array,
    config: HypothesesConfig,
    *,
    seed: int,
    device: str,
) -> HypothesisPosterior:
    """Only hypotheses that a particle gets cost a mean function."""
    kept, which = np.unique(
        systematic_resampling(weights, config.map.particles), return_inverse=True
    )
    part = None
    if len(placed) in kept:
        part = visible_part(
            observation.points, frame, observation.object_id, plane, config.completion
        )
    extent = np.concatenate(
        [observation.points]
        + [_surface(placed[i]) for i in kept if i < len(placed)]
        + ([] if part is None else [part.extent])
    )
    margin = config.map.margin
    box = np.stack([extent.min(axis=0) - margin, extent.max(axis=0) + margin])
    lower, spacing, nodes = grid_over(box, config.mean)
    empty = empty_space(nodes.reshape(-1, 3), frame, observation.object_id, plane, config.mean)
    empty = empty.reshape(nodes.shape[:3])
    mean = [
        completed_grid(nodes, empty, part, config.mean)
        if part is not None and i == len(placed)
        else _placed_grid(nodes, empty, placed[i], config.mean)
        for i in kept
    ]
    grid = PriorMeanGrid(lower, spacing, np.stack(mean), outside=-config.mean.limit)
    return infer_correction(
        Problem(LabelledPoints(observation.samples, observation.labels), grid, which, box),
        config.map,
        seed=child_seed(seed, observation.object_id),
        device=device,
    )


def _placed_grid(
    nodes: Array, empty: NDArray[np.bool_], hypothesis: Hypothesis, config: MeanConfig
) -> NDArray[np.float16]:
    """Logits (nx, ny, nz) of a placed shape at nodes (nx, ny, nz, 3), but where it is empty."""
    logits = np.full(empty.shape, -config.limit, np.float16)
    distance = _distance(hypothesis, nodes[~empty])
    logits[~empty] = shape_logits(distance, hypothesis.alignment_score, config)
    return logits


def _surface(hypothesis: Hypothesis) -> Array:
    return np.asarray(transform_points(hypothesis.T_cam_model, hypothesis.model.surface))


def _distance(hypothesis: Hypothesis, points: Array) -> Array:
    """Signed distance (n,), metres, of points (n, 3), camera frame, to the placed shape."""
    stored = hypothesis.model.stored
    T_object_cam = np.linalg.inv(hypothesis.T_cam_object)
    unit = stored.half_extent * hypothesis.scale
    return stored.distances.signed_distance(transform_points(T_object_cam, points)) * unit


def _shuffled(points: NDArray[np.float32], seed: int, object_id: int) -> Array:
    """In random order: every leading part covers what was seen."""
    rng = child_rng(seed, "testimony", object_id)
    return rng.permutation(points).astype(np.float64)


def _retrieved(name: str, probability: float, group: list[Hypothesis], weight: float) -> Retrieved:
    """The object with its best placement, and the weight of all of them."""
    if not group:
        return Retrieved(name, probability, weight=weight)
    best = group[0]
    return Retrieved(
        name,
        probability,
        best.T_cam_object,
        best.scale,
        alignment_score=best.alignment_score,
        weight=weight,
    )
