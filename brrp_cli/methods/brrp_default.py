"""BRRP by hypotheses: retrieve, place in many ways, verify, weigh, infer (the default preset)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from brrp_cli.completion.seen_surface import SeenSurface, seen_surface
from brrp_cli.config import FittedMapConfig, HypothesesConfig
from brrp_cli.config.registration import TrialConfig
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.methods.each_object import too_few
from brrp_cli.methods.earlier_views import ALONE, EarlierViews, remember
from brrp_cli.methods.infer_object import Shown, infer_object, placed_shape, shown_of
from brrp_cli.methods.kin_hypotheses import KinHypothesis, beside_round, kin_hypotheses
from brrp_cli.methods.placements import Placements, Placer
from brrp_cli.methods.scene import Scene
from brrp_cli.observation.ray_samples import ObjectObservation
from brrp_cli.reconstruction import OK, ObjectReconstruction, Similar
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.seen_mask import SeenMask, seen_mask
from brrp_cli.registration.verification import Verifier, in_waves
from brrp_cli.registration.weigh import counted_once
from brrp_cli.retrieval.base import top_k, unknown
from brrp_cli.seeds import child_rng
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
    frame, clear, image, seed = scene.frame, scene.clear, scene.image, scene.seed
    hypotheses = _hypotheses(scene, trial)
    object_id = observation.object_id
    points = _shuffled(observation.points, seed, object_id)
    mask = seen_mask(frame, object_id, len(points), image.plane, hypotheses.mask)
    verifier = Verifier(points, frame, image.plane, mask)
    views = ALONE if earlier is None else earlier
    seconds: dict[str, float] = {}
    begun: dict[str, list[Hypothesis]] = {}
    if views:
        with timed(seconds, "start"):
            begun = views.begun(scene.prior, verifier, hypotheses)
            if not views.agree(begun, hypotheses.search.model_points):
                # It has been moved: what was seen of it elsewhere is forgotten.
                views, begun = EarlierViews((), views.config), {}
    believed = views.probabilities(probabilities)
    chosen = _chosen(scene, believed, begun, trial)
    told = partial(
        ObjectReconstruction,
        object_id=object_id,
        status=OK,
        n_points=len(observation.points),
        center=observation.center,
        observed=np.concatenate([observation.points, *views.points()]),
        unknown_probability=unknown(believed),
        seconds=seconds,
    )
    with timed(seconds, "registration"):
        placer = Placer(scene, observation, verifier, hypotheses, views)
        found = placer.placements(chosen, begun)
        told = partial(told, unknown_weight=found.unknown)
        if trial is not None:
            return told(retrieved=found.retrieved())
        least = scene.config.observation.min_points
        few, known = len(points) < least, found.unknown <= 0.5
        if few and (image.plane is None or not known):
            return too_few(object_id, len(points), least)
        like: list[KinHypothesis] = []
        if not few and found.unknown >= hypotheses.kin.least_unknown:
            like = kin_hypotheses(
                clear.object_points(object_id),
                clear,
                object_id,
                image.plane,
                scene.prior,
                hypotheses,
                seed,
                views.points(),
                views.depths(),
                image.mixing,
            )

    @cache
    def surface() -> SeenSurface:
        return seen_surface(clear, object_id, image.plane, image.noise, hypotheses.mean.ramp)

    @cache
    def shown() -> Shown:
        cell = scene.config.observation.surface_cell
        return shown_of(surface(), observation, image.plane, cell, hypotheses)

    with timed(seconds, "inference"):
        if like and shown().axis is not None:
            like = beside_round(like, hypotheses.kin)
        shared = _shared_with_kin(found.weights, like)
        if few:
            # No shape is made of so few points.
            shared[-1] = 0
        kept = _kept(shared, hypotheses.map)
        found, alike = placer.settled(found, kept[kept < len(found.placed)])
        shared[: len(found.placed)] = found.weights[:-1]
        posterior, guess = infer_object(
            observation,
            frame,
            image.plane,
            shown,
            image.wave,
            _shapes(kept, found, alike, like, scene, observation, hypotheses, views, mask),
            shared[kept] / shared[kept].sum(),
            hypotheses,
            views,
            # Strays of what a mask has placed would dent it.
            trusted=mask is None or mask.trust == 1 or not known,
            seed=seed,
            device=scene.device,
        )
    memory = None
    if earlier is not None:
        memory = remember(
            frame,
            image.plane,
            image.wave,
            observation,
            verifier.points,
            placer.seen,
            probabilities,
            [(each, float(w)) for each, w in zip(found.placed, found.weights, strict=False)],
            found.ratios(),
            guess,
            surface(),
            not views,
            views.config.samples,
            child_rng(seed, "remembered", object_id),
            hypotheses,
        )
    return told(
        retrieved=found.retrieved(),
        similar=[
            Similar(each.shape.name, found.unknown * each.share, each.scales) for each in like
        ],
        posterior=posterior,
        memory=memory,
    )


def _hypotheses(scene: Scene, trial: TrialConfig | None) -> HypothesesConfig:
    """The configuration, as the frame's waves ask for; of a trial, one that gives up sooner."""
    assert scene.config.hypotheses is not None
    hypotheses = counted_once(scene.config.hypotheses, scene.aligns)
    hypotheses = replace(hypotheses, search=in_waves(hypotheses.search, scene.image.wave))
    if trial is None:
        return hypotheses
    short = replace(
        hypotheses.search,
        unpromising=trial.unpromising,
        hopeless=trial.hopeless,
        # How it is turned is of no matter yet.
        colour=replace(hypotheses.search.colour, asked=False),
    )
    return replace(hypotheses, search=short)


def _chosen(
    scene: Scene,
    probabilities: Array,
    begun: dict[str, list[Hypothesis]],
    trial: TrialConfig | None,
) -> list[tuple[str, float]]:
    """Names and P(c|R) of the stored objects that are tried: the k most probable ones, of a trial
    those that are about as probable as the first, and those that earlier frames began with."""
    names, k = scene.prior.names, scene.config.k
    chosen = top_k(probabilities, names, k if trial is None else min(k, trial.objects))
    if trial is not None:
        chosen = [each for each in chosen if each[1] >= trial.likely * chosen[0][1]]
    more = [name for name in begun if name not in dict(chosen)]
    return chosen + [(name, float(probabilities[names.index(name)])) for name in more]


def _shapes(
    kept: NDArray[np.int64],
    found: Placements,
    alike: dict[int, Array],
    like: list[KinHypothesis],
    scene: Scene,
    observation: ObjectObservation,
    config: HypothesesConfig,
    views: EarlierViews,
    mask: SeenMask | None,
) -> list[PlacedShape]:
    """Of the hypotheses `kept`: placements first, then kin; the completion has none."""
    count = len(found.placed)
    return [
        placed_shape(
            found.placed[i], observation.points, scene.image.wave, config, views, alike.get(i), mask
        )
        if i < count
        else like[i - count].shape
        for i in kept.tolist()
        if i < count + len(like)
    ]


def _shared_with_kin(weights: Array, like: list[KinHypothesis]) -> Array:
    """Weights of what was placed, of kin, and of the completion: kin take from "none of them"."""
    none = weights[-1]
    shares = [none * each.share for each in like]
    return np.array([*weights[:-1], *shares, none - sum(shares)])


def _kept(weights: Array, config: FittedMapConfig) -> NDArray[np.int64]:
    """The hypotheses that weigh `config.least_weight`, the heaviest of them where there are more
    than particles, in their order."""
    order = np.argsort(-weights, kind="stable")[: config.particles]
    return np.sort(order[(weights[order] >= config.least_weight) | (np.arange(len(order)) == 0)])


def _shuffled(points: NDArray[np.float32], seed: int, object_id: int) -> Array:
    """In random order: every leading part covers what was seen."""
    rng = child_rng(seed, "testimony", object_id)
    return rng.permutation(points).astype(np.float64)
