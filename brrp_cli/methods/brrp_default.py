"""BRRP by hypotheses: retrieve, place in many ways, verify, weigh, infer (the default preset)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from brrp_cli.completion.seen_surface import SeenSurface, seen_surface
from brrp_cli.config import FittedMapConfig, HypothesesConfig
from brrp_cli.config.registration import TrialConfig
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.methods.each_object import too_few
from brrp_cli.methods.earlier_views import (
    ALONE,
    EarlierViews,
    Guess,
    PlacedEarlier,
    Remembered,
    thinned,
)
from brrp_cli.methods.infer_object import Shown, infer_object, placed_shape, shown_of
from brrp_cli.methods.kin_hypotheses import KinHypothesis, beside_round, kin_hypotheses
from brrp_cli.methods.placements import Placements, Placer
from brrp_cli.methods.scene import SeenScene
from brrp_cli.observation.ray_samples import ObjectObservation
from brrp_cli.observation.soft_samples import soft_samples
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
    scene: SeenScene,
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
    seconds: dict[str, float] = {}
    thing = _looked_at(scene, observation, earlier, trial, seconds)
    config, views = thing.config, thing.views
    believed = views.probabilities(probabilities)
    told = partial(
        ObjectReconstruction,
        object_id=observation.object_id,
        status=OK,
        n_points=len(observation.points),
        center=observation.center,
        observed=np.concatenate([observation.points, *views.points()]),
        unknown_probability=unknown(believed),
        seconds=seconds,
    )
    with timed(seconds, "registration"):
        placer = Placer(scene, observation, thing.verifier, config, views)
        found = placer.placements(_chosen(scene, believed, thing.begun, trial), thing.begun)
        told = partial(told, unknown_weight=found.unknown)
        if trial is not None:
            return told(retrieved=found.retrieved())
        if thing.few and (scene.image.plane is None or not _known(found)):
            least = scene.config.observation.min_points
            return too_few(observation.object_id, len(observation.points), least)
        asks_kin = not thing.few and found.unknown >= config.kin.least_unknown
        like = _kin(thing) if asks_kin else []
    with timed(seconds, "inference"):
        if like and thing.shown.axis is not None:
            like = beside_round(like, config.kin)
        found, posterior, guess = _inferred(thing, placer, found, like)
    return told(
        retrieved=found.retrieved(),
        similar=[
            Similar(each.shape.name, found.unknown * each.share, each.scales) for each in like
        ],
        posterior=posterior,
        memory=None if earlier is None else _memory(thing, placer, found, probabilities, guess),
    )


@dataclass(frozen=True)
class _Thing:
    """One object that is looked at in its scene, as all steps need it.

    config : as the frame's waves and a trial ask for; mask : where depth shows too little of it;
    views : earlier ones of it where it is now; begun : its placements in the last, by name
    """

    scene: SeenScene
    observation: ObjectObservation
    config: HypothesesConfig
    mask: SeenMask | None
    verifier: Verifier
    views: EarlierViews
    begun: dict[str, list[Hypothesis]]

    @property
    def few(self) -> bool:
        """Whether too few points are seen to make a shape of them."""
        return len(self.observation.points) < self.scene.config.observation.min_points

    @cached_property
    def surface(self) -> SeenSurface:
        """What is seen of its surface, smoothed."""
        image, object_id = self.scene.image, self.observation.object_id
        ramp = self.config.mean.ramp
        return seen_surface(self.scene.clear, object_id, image.plane, image.noise, ramp)

    @cached_property
    def shown(self) -> Shown:
        """What its completion starts from."""
        cell, plane = self.scene.config.observation.surface_cell, self.scene.image.plane
        return shown_of(self.surface, self.observation, plane, cell, self.config)


def _looked_at(
    scene: SeenScene,
    observation: ObjectObservation,
    earlier: EarlierViews | None,
    trial: TrialConfig | None,
    seconds: dict[str, float],
) -> _Thing:
    """The object with what earlier frames say of it, unless it has been moved since."""
    config, plane, object_id = _hypotheses(scene, trial), scene.image.plane, observation.object_id
    points = _shuffled(observation.points, scene.seed, object_id)
    mask = seen_mask(scene.frame, object_id, len(points), plane, config.mask)
    verifier = Verifier(points, scene.frame, plane, mask)
    views = ALONE if earlier is None else earlier
    begun: dict[str, list[Hypothesis]] = {}
    if views:
        with timed(seconds, "start"):
            begun = views.begun(scene.prior, verifier, config)
            if not views.agree(begun, config.search.model_points):
                # It has been moved: what was seen of it elsewhere is forgotten.
                views, begun = EarlierViews((), views.config), {}
    return _Thing(scene, observation, config, mask, verifier, views, begun)


def _known(found: Placements) -> bool:
    """Whether it is a stored object rather than none of them."""
    return found.unknown <= 0.5


def _kin(thing: _Thing) -> list[KinHypothesis]:
    """Hypotheses that it is like a stored object."""
    scene, views, object_id = thing.scene, thing.views, thing.observation.object_id
    return kin_hypotheses(
        scene.clear.object_points(object_id),
        scene.clear,
        object_id,
        scene.image.plane,
        scene.prior,
        thing.config,
        scene.seed,
        views.points(),
        views.depths(),
        scene.image.mixing,
    )


def _inferred(
    thing: _Thing, placer: Placer, found: Placements, like: list[KinHypothesis]
) -> tuple[Placements, HypothesisPosterior, Guess | None]:
    """Placements brought nearer, the posterior of all hypotheses that weigh enough, and what the
    completion's network thinks, where it is asked."""
    scene, config = thing.scene, thing.config
    shared = _shared_with_kin(found.weights, like)
    if thing.few:
        # No shape is made of so few points.
        shared[-1] = 0
    kept = _kept(shared, config.map)
    found = placer.settled(found, kept[kept < len(found.placed)])
    shared[: len(found.placed)] = found.weights[:-1]
    posterior, guess = infer_object(
        thing.observation,
        scene.frame,
        scene.image.plane,
        lambda: thing.shown,
        scene.image.wave,
        _shapes(thing, kept, found, like),
        shared[kept] / shared[kept].sum(),
        config,
        thing.views,
        # Strays of what a mask has placed would dent it.
        trusted=thing.mask is None or thing.mask.trust == 1 or not _known(found),
        seed=scene.seed,
        device=scene.device,
    )
    return found, posterior, guess


def _memory(
    thing: _Thing, placer: Placer, found: Placements, probabilities: Array, guess: Guess | None
) -> Remembered:
    """The object for the frames to come; probabilities : P(c|R) (n,) of this frame alone."""
    scene, observation, config = thing.scene, thing.observation, thing.config
    samples = soft_samples(observation, scene.frame, config.map.behind, config.sensor)
    rng = child_rng(scene.seed, "remembered", observation.object_id)
    return Remembered(
        frame=scene.frame,
        object_id=observation.object_id,
        plane=scene.image.plane,
        points=thing.verifier.points,
        seen=placer.seen,
        samples=thinned(samples, thing.views.config.samples, rng),
        wave=scene.image.wave,
        probabilities=probabilities,
        placed=tuple(
            PlacedEarlier.of(each, float(w))
            for each, w in zip(found.placed, found.weights, strict=False)
        ),
        ratios=found.ratios(),
        guess=guess,
        surface=thing.surface,
        alone=not thing.views,
    )


def _hypotheses(scene: SeenScene, trial: TrialConfig | None) -> HypothesesConfig:
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
    scene: SeenScene,
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
    thing: _Thing,
    kept: NDArray[np.int64],
    found: Placements,
    like: list[KinHypothesis],
) -> list[PlacedShape]:
    """Of the hypotheses `kept`: placements first, then kin; the completion has none."""
    count = len(found.placed)

    def placed(i: int) -> PlacedShape:
        return placed_shape(
            found.placed[i],
            thing.observation.points,
            thing.scene.image.wave,
            thing.config,
            thing.views,
            found.alike.get(i),
            thing.mask,
        )

    return [
        placed(i) if i < count else like[i - count].shape
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
