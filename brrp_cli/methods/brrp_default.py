"""BRRP by hypotheses: retrieve, place in many ways, verify, weigh, infer (the default preset)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brrp_cli.completion.seen_surface import seen_surface
from brrp_cli.config import FittedMapConfig, HypothesesConfig
from brrp_cli.config.registration import TrialConfig
from brrp_cli.methods.earlier_views import ALONE, EarlierViews, remember
from brrp_cli.methods.infer_object import Shown, infer_object, placed_shape, shown_of
from brrp_cli.methods.kin_hypotheses import KinHypothesis, beside_round, kin_hypotheses
from brrp_cli.methods.scene import Scene
from brrp_cli.observation.ray_samples import ObjectObservation
from brrp_cli.reconstruction import OK, ObjectReconstruction, Retrieved, Similar
from brrp_cli.registration.likelihood import SeenObject, evidence, log_likelihood, see
from brrp_cli.registration.model import Model, search_model
from brrp_cli.registration.pose_search import Hypothesis, search
from brrp_cli.registration.refined import refined
from brrp_cli.registration.scale_scan import observed_cloud
from brrp_cli.registration.turned import turned
from brrp_cli.registration.verification import Verifier
from brrp_cli.registration.weigh import (
    SeenFrom,
    best_ratios,
    counted_once,
    joint_log_likelihood,
    judged,
    weigh,
)
from brrp_cli.retrieval.base import top_k, unknown
from brrp_cli.seeds import child_rng, child_seed
from brrp_cli.timing import timed

Array = NDArray[np.float64]


def reconstruct_by_hypotheses(
    scene: Scene,
    observation: ObjectObservation,
    probabilities: Array,
    *,
    earlier: EarlierViews | None = None,
    trial: TrialConfig | None = None,
) -> ObjectReconstruction:
    """Posterior of one object from hypotheses about the k retrieved objects and from the one that
    it is none of them, each corrected by what was observed.

    probabilities : P(c|R) (n,); earlier : views of the object in the stream's earlier frames; None
    = there is no stream; trial : nothing is inferred, only told which stored objects lie there
    """
    frame, image = scene.frame, scene.image
    plane, wave, noise = image.plane, image.wave, image.noise
    prior, config, seed, device = scene.prior, scene.config, scene.seed, scene.device
    assert config.hypotheses is not None
    hypotheses = counted_once(config.hypotheses, scene.aligns)
    if trial is not None:
        short = replace(
            hypotheses.search,
            unpromising=trial.unpromising,
            hopeless=trial.hopeless,
            # How it is turned is of no matter yet.
            colour=replace(hypotheses.search.colour, asked=False),
        )
        hypotheses = replace(hypotheses, search=short)
    seconds: dict[str, float] = {}
    object_id = observation.object_id
    views = ALONE if earlier is None else earlier
    verifier = Verifier(_shuffled(observation.points, seed, object_id), frame, plane)
    begun: dict[str, list[Hypothesis]] = {}
    if views:
        with timed(seconds, "start"):
            begun = views.begun(prior, verifier, hypotheses)
            if not views.agree(begun, hypotheses.search.model_points):
                # It has been moved: what was seen of it elsewhere is forgotten.
                views, begun = EarlierViews((), views.config), {}
    seen_now, probabilities = probabilities, views.probabilities(probabilities)
    count = config.k if trial is None else min(config.k, trial.objects)
    chosen = top_k(probabilities, prior.names, count)
    if trial is not None:
        chosen = [each for each in chosen if each[1] >= trial.likely * chosen[0][1]]
    chosen += [
        (name, float(probabilities[prior.names.index(name)]))
        for name in begun
        if name not in dict(chosen)
    ]
    missing = unknown(probabilities)
    # Stored objects that are not tried are as good as not in the prior.
    none_tried = unknown(np.array([probability for _, probability in chosen]))
    told = partial(
        ObjectReconstruction,
        object_id=object_id,
        status=OK,
        n_points=len(observation.points),
        center=observation.center,
        observed=observation.points,
        unknown_probability=missing,
        seconds=seconds,
    )
    with timed(seconds, "registration"):
        observed = observed_cloud(observation.points, config.features)
        lost = views.lost(hypotheses) if begun else frozenset()
        sensor = hypotheses.sensor
        seen = see(
            frame, object_id, plane, noise, sensor.patch, sensor.bleed, hypotheses.likelihood
        )

        def searched(skipped: frozenset[str]) -> list[list[Hypothesis]]:
            found: list[list[Hypothesis]] = []
            # P(c|R) of the most probable object that explains what is seen.
            explained = 0.0
            for name, probability in chosen:
                if name in skipped:
                    found.append(begun.get(name, []))
                    continue
                if probability < hypotheses.search.unlikely * explained:
                    found.append([])
                    continue
                best = (each.alignment_score for group in found for each in group)
                found.append(
                    search(
                        search_model(prior.load(name)),
                        observed,
                        verifier,
                        config.features,
                        hypotheses.search,
                        child_seed(seed, object_id),
                        max(best, default=-np.inf),
                    )
                )
                if found[-1][0].alignment_score >= hypotheses.search.explained:
                    explained = max(explained, probability)
            return found

        def nearer(each: Hypothesis) -> Hypothesis:
            return refined(each, verifier, wave, hypotheses, views.rays())

        def weighed(found: list[list[Hypothesis]]) -> tuple[list[Hypothesis], list[float], Array]:
            placed = [each for group in found for each in group]
            shares = [p for (_, p), group in zip(chosen, found, strict=True) for _ in group]
            placed, alone = judged(placed, seen, hypotheses, nearer)
            joint = alone
            if views and max(alone, default=-np.inf) > -views.config.against:
                placed, joint = _in_all_views(
                    placed, alone, observation, seen, verifier, wave, hypotheses, views
                )
            return placed, alone, weigh(shares, joint, none_tried, hypotheses.weigh)

        found = searched(frozenset(begun) | lost | views.hopeless())
        placed, alone, weights = weighed(found)
        if begun and _heaviest(found, weights) < views.config.sure:
            # What started from the last frame is not sure: it is searched for as ever.
            found = searched(views.hopeless())
            placed, alone, weights = weighed(found)
        told = partial(told, unknown_weight=float(weights[-1]))
        if trial is not None:
            return told(retrieved=_all_retrieved(chosen, found, placed, weights))
        like: list[KinHypothesis] = []
        if weights[-1] >= hypotheses.kin.least_unknown:
            like = kin_hypotheses(
                observation.points,
                frame,
                object_id,
                plane,
                prior,
                hypotheses,
                seed,
                views.points(),
                views.depths(),
            )

    @cache
    def shown() -> Shown:
        surface = seen_surface(frame, object_id, plane, noise, hypotheses.mean.ramp)
        cell = config.observation.surface_cell
        return shown_of(surface, observation, plane, cell, hypotheses)

    with timed(seconds, "inference"):
        if like and shown().axis is not None:
            like = beside_round(like, hypotheses.kin)
        shared = _shared_with_kin(weights, like)
        kept = _kept(shared, hypotheses.map)
        alike: dict[int, Array] = {}
        for i in kept[kept < len(placed)]:
            placed[i] = nearer(placed[i])
            if not views:
                judge = partial(
                    _log_likelihood, model=placed[i].model, seen=seen, config=hypotheses
                )
                best = turned(
                    placed[i], verifier, hypotheses.sensor.patch, hypotheses.search, judge, nearer
                )
                placed[i], alike[i] = best.best, best.alike
        shapes = [
            placed_shape(placed[i], observation.points, wave, hypotheses, views, alike.get(i))
            if i < len(placed)
            else like[i - len(placed)].shape
            for i in kept
            if i < len(placed) + len(like)
        ]
        posterior, guess = infer_object(
            observation,
            frame,
            plane,
            shown,
            wave,
            shapes,
            shared[kept] / shared[kept].sum(),
            hypotheses,
            views,
            seed=seed,
            device=device,
        )
    memory = None
    if earlier is not None:
        memory = remember(
            frame,
            plane,
            noise,
            wave,
            observation,
            verifier.points,
            seen_now,
            [(each, float(weight)) for each, weight in zip(placed, weights, strict=False)],
            best_ratios(placed, alone),
            guess,
            shown().surface,
            not views,
            views.config.samples,
            child_rng(seed, "remembered", object_id),
            hypotheses,
        )
    similar = [
        Similar(each.shape.name, float(weights[-1]) * each.share, each.scales) for each in like
    ]
    return told(
        retrieved=_all_retrieved(chosen, found, placed, weights),
        similar=similar,
        posterior=posterior,
        memory=memory,
    )


def _log_likelihood(
    T_cam_model: Array, model: Model, seen: SeenObject, config: HypothesesConfig
) -> float:
    """Of a placement, against that it is none of the stored objects, nats."""
    likelihood = config.likelihood
    found = evidence(T_cam_model, model, seen, likelihood, config.search.colour)
    return log_likelihood(found, likelihood)


def _shared_with_kin(weights: Array, like: list[KinHypothesis]) -> Array:
    """Weights of what was placed, of kin, and of the completion: kin take from "none of them"."""
    none = weights[-1]
    shares = [none * each.share for each in like]
    return np.array([*weights[:-1], *shares, none - sum(shares)])


def _in_all_views(
    placed: list[Hypothesis],
    alone: list[float],
    observation: ObjectObservation,
    seen: SeenObject,
    verifier: Verifier,
    wave: float,
    config: HypothesesConfig,
    views: EarlierViews,
) -> tuple[list[Hypothesis], list[float]]:
    """Placements fitted to the rays of all views, and their log likelihood ratios in all of them:
    of those whose ratio in this frame, `alone`, comes near the best."""
    every = [SeenFrom(seen, np.eye(4)), *views.seen()]
    votes = views.votes(observation.center)
    near = [ratio > max(alone) - views.config.worth for ratio in alone]
    placed = [
        refined(each, verifier, wave, config, views.rays()) if asked else each
        for each, asked in zip(placed, near, strict=True)
    ]
    asked_ratios = [
        joint_log_likelihood(each, every, votes, config) if asked else -np.inf
        for each, asked in zip(placed, near, strict=True)
    ]
    # The others stay as far behind as they were.
    gained = max(asked_ratios) - max(alone)
    joint = [
        ratio if asked else before + gained
        for ratio, before, asked in zip(asked_ratios, alone, near, strict=True)
    ]
    return placed, joint


def _heaviest(found: list[list[Hypothesis]], weights: Array) -> float:
    """Weight of the heaviest stored object, of all of its placements."""
    ends = np.cumsum([0, *(len(group) for group in found)])
    return max((float(weights[a:b].sum()) for a, b in pairwise(ends)), default=0.0)


def _kept(weights: Array, config: FittedMapConfig) -> NDArray[np.int64]:
    """The hypotheses that weigh `config.least_weight`, the heaviest of them where there are more
    than particles, in their order."""
    order = np.argsort(-weights, kind="stable")[: config.particles]
    return np.sort(order[(weights[order] >= config.least_weight) | (np.arange(len(order)) == 0)])


def _shuffled(points: NDArray[np.float32], seed: int, object_id: int) -> Array:
    """In random order: every leading part covers what was seen."""
    rng = child_rng(seed, "testimony", object_id)
    return rng.permutation(points).astype(np.float64)


def _all_retrieved(
    chosen: list[tuple[str, float]],
    found: list[list[Hypothesis]],
    placed: list[Hypothesis],
    weights: Array,
) -> list[Retrieved]:
    """Of each retrieved object its placements, of `placed`, as many as were `found`."""
    ends = np.cumsum([0, *(len(group) for group in found)])
    return [
        _retrieved(name, probability, placed[a:b], float(weights[a:b].sum()))
        for (name, probability), a, b in zip(chosen, ends[:-1], ends[1:], strict=True)
    ]


def _retrieved(name: str, probability: float, group: list[Hypothesis], weight: float) -> Retrieved:
    """The object with its best placement, and the weight of all of them."""
    if not group:
        return Retrieved(name, probability, weight=weight)
    best = group[0]
    T_cam_mesh, _ = best.model.stored.mesh_pose(best.T_cam_object)
    return Retrieved(
        name,
        probability,
        best.T_cam_object,
        T_cam_mesh,
        best.scale,
        alignment_score=best.alignment_score,
        weight=weight,
    )
