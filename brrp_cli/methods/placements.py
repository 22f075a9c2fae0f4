"""Which stored objects lie where: searched for in what is seen of one, judged and weighed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import HypothesesConfig
from brrp_cli.methods.earlier_views import EarlierViews
from brrp_cli.methods.scene import SeenScene
from brrp_cli.observation.ray_samples import ObjectObservation
from brrp_cli.reconstruction import Retrieved
from brrp_cli.registration.by_print import joint_print_nats, turned_by_print
from brrp_cli.registration.likelihood import SeenPixels, see
from brrp_cli.registration.model import Model, search_model
from brrp_cli.registration.pose_covariance import pose_covariance
from brrp_cli.registration.pose_search import Hypothesis, search
from brrp_cli.registration.refined import refined
from brrp_cli.registration.scale_scan import observed_cloud
from brrp_cli.registration.turned import turned
from brrp_cli.registration.verification import Verifier
from brrp_cli.registration.views import SeenFrom, Views
from brrp_cli.registration.weigh import (
    best_ratios,
    joint_log_likelihood,
    judged,
    other_size,
    piece_doubt,
    weigh,
)
from brrp_cli.retrieval.base import unknown
from brrp_cli.seeds import child_rng, child_seed

Array = NDArray[np.float64]
# Name and P(c|R) of stored objects.
Chosen = Sequence[tuple[str, float]]


@dataclass(frozen=True)
class Placements:
    """Where retrieved objects may lie.

    chosen : the m objects that were tried; counts : (m,) how many placements there are of each
    placed : all n of them, in the order of `chosen`, by alignment score
    alone : (n,) log likelihood ratios in this frame, nats, against that it is none of them
    weights : (n + 1,) of the placements, and last that it is none of them
    alike : by index, (K, 4, 4) T_cam_model of turns that are as probable as that placement
    """

    chosen: Chosen
    counts: Sequence[int]
    placed: Sequence[Hypothesis]
    alone: Sequence[float]
    weights: Array
    alike: Mapping[int, Array] = field(default_factory=dict)

    @property
    def unknown(self) -> float:
        """Weight of "none of them"."""
        return float(self.weights[-1])

    @property
    def heaviest(self) -> float:
        """Weight of the heaviest stored object, of all of its placements."""
        return max((float(self.weights[a:b].sum()) for a, b in self.groups()), default=0.0)

    def ratios(self) -> dict[str, float]:
        """Of each object the best log likelihood ratio in this frame, nats."""
        return best_ratios(self.placed, self.alone)

    def retrieved(self) -> list[Retrieved]:
        """Each object with its heaviest placement, the first of those that weigh as much, and the
        weight of all of them."""
        return [
            self._retrieved(name, probability, slice(a, b))
            for (name, probability), (a, b) in zip(self.chosen, self.groups(), strict=True)
        ]

    def _retrieved(self, name: str, probability: float, of: slice) -> Retrieved:
        weight = float(self.weights[of].sum())
        if not self.placed[of]:
            return Retrieved(name, probability, weight=weight)
        row = of.start + int(self.weights[of].argmax())
        best = self.placed[row]
        stored, turned = best.model.stored, self.alike.get(row, np.empty((0, 4, 4)))
        return Retrieved(
            name,
            probability,
            best.T_cam_object,
            stored.mesh_pose(best.T_cam_object)[0],
            best.scale,
            alignment_score=best.alignment_score,
            weight=weight,
            alike=tuple(stored.mesh_pose(T @ best.model.T_model_object)[0] for T in turned),
        )

    def groups(self) -> Iterable[tuple[int, int]]:
        """First and last but one index of each object's placements."""
        return pairwise(np.cumsum([0, *self.counts]).tolist())


class Placer:
    """Looks for stored objects in what is seen of one object.

    seen : its pixels, as placements are judged by them
    """

    def __init__(
        self,
        scene: SeenScene,
        observation: ObjectObservation,
        verifier: Verifier,
        config: HypothesesConfig,
        views: EarlierViews,
    ) -> None:
        image, sensor = scene.image, config.sensor
        self._scene = scene
        self._observation = observation
        self._verifier = verifier
        self._config = config
        self._views = views
        self._observed = observed_cloud(observation.points, scene.config.features)
        self.seen: SeenPixels = see(
            scene.frame,
            observation.object_id,
            image.plane,
            image.noise,
            sensor.patch,
            sensor.bleed,
            config.likelihood,
            verifier.lost,
        )

    @cached_property
    def _every_view(self) -> Views:
        """The present view, and the earlier ones."""
        views, points = self._views, self._verifier.points
        seen = SeenFrom(self.seen, np.eye(4)), *views.seen()
        if views:
            # The first points of all are to be from all views.
            points = np.concatenate([points, *views.points()])
            rng = child_rng(self._scene.seed, "views", self._observation.object_id)
            points = points[rng.permutation(len(points))]
        return Views(seen, points, views.votes(self._observation.center))

    def placements(self, chosen: Chosen, begun: dict[str, list[Hypothesis]]) -> Placements:
        """Of the objects `chosen`. `begun` : those that start from earlier frames, by name; they
        are searched for too where that leaves doubt. Errors: PriorError."""
        views = self._views
        lost = views.lost(self._config) if begun else frozenset()
        skipped = frozenset(begun) | lost | views.hopeless()
        found = self._weighed(chosen, self._searched(chosen, begun, skipped))
        if begun and found.heaviest < views.config.sure:
            # What started from the last frame is not sure: it is searched for as ever.
            found = self._weighed(chosen, self._searched(chosen, begun, views.hopeless()))
        return found

    def settled(self, found: Placements, kept: NDArray[np.int64]) -> Placements:
        """The placements with those of the indices `kept` brought nearer and turned as is most
        probable, and the turns that are as good. The weight of an object stays; that of its
        placements follows from how probable they have become."""
        placed, alike = list(found.placed), dict[int, Array]()
        for i in kept.tolist():
            placed[i] = self._turned_by_print(self._nearer(placed[i]))
            best = turned(
                placed[i],
                self._verifier,
                self._every_view,
                self._config.sensor.patch,
                self._config.search,
                partial(self._as_printed, placed[i].model),
                self._nearer,
                self._config.search.about_itself.steady if self._views else 0.0,
            )
            placed[i], alike[i] = best.best, best.alike
        weights = found.weights.copy()
        for a, b in found.groups():
            of_one = kept[(a <= kept) & (kept < b)]
            if len(of_one) > 1:
                weights[of_one] = self._shared_out(
                    weights[of_one].sum(), [placed[i] for i in of_one.tolist()]
                )
        return replace(found, placed=placed, weights=weights, alike=alike)

    def _shared_out(self, weight: float, placed: Sequence[Hypothesis]) -> Array:
        """The weight of placements of one object, (n,), as probable as they are."""
        log = np.array(
            [
                self._log_likelihood(each.model, each.T_cam_model) - other_size(each, self._config)
                for each in placed
            ]
        )
        share = np.exp(log - log.max())
        return np.asarray(weight * share / share.sum())

    def _searched(
        self, chosen: Chosen, begun: dict[str, list[Hypothesis]], skipped: frozenset[str]
    ) -> list[list[Hypothesis]]:
        """Placements of each object; of those that are skipped, the ones that were begun."""
        config, scene = self._config.search, self._scene
        found: list[list[Hypothesis]] = []
        # P(c|R) of the most probable object that explains what is seen.
        explained = 0.0
        for name, probability in chosen:
            if name in skipped:
                found.append(begun.get(name, []))
                continue
            if probability < config.unlikely * explained:
                found.append([])
                continue
            best = (each.alignment_score for group in found for each in group)
            found.append(
                search(
                    search_model(scene.prior.load(name)),
                    self._observed,
                    self._verifier,
                    scene.config.features,
                    config,
                    child_seed(scene.seed, self._observation.object_id),
                    max(best, default=-np.inf),
                )
            )
            if found[-1][0].alignment_score >= config.explained:
                explained = max(explained, probability)
        return found

    def _weighed(self, chosen: Chosen, found: list[list[Hypothesis]]) -> Placements:
        views = self._views
        placed = [each for group in found for each in group]
        shares = [p for (_, p), group in zip(chosen, found, strict=True) for _ in group]
        if self._verifier.mask is not None:
            placed = [self._nearer_if_better(each) for each in placed]
        placed, alone = judged(placed, self.seen, self._config, self._nearer)
        joint = alone
        if views and max(alone, default=-np.inf) > -views.config.against:
            placed, joint = self._in_all_views(placed, alone)
        # Stored objects that are not tried are as good as not in the prior.
        none_tried = unknown(np.array([probability for _, probability in chosen]))
        weights = weigh(shares, joint, none_tried, self._config.weigh, self._doubt())
        return Placements(chosen, [len(group) for group in found], placed, alone, weights)

    def _doubt(self) -> float:
        """Nats for "none of them", in a mask that nobody gave."""
        scene, object_id = self._scene, self._observation.object_id
        if scene.given is None or object_id in scene.given:
            return 0.0
        return piece_doubt(int((scene.frame.segmap == object_id).sum()), self._config.weigh)

    def _in_all_views(
        self, placed: list[Hypothesis], alone: list[float]
    ) -> tuple[list[Hypothesis], list[float]]:
        """Placements fitted to the rays of all views, and their log likelihood ratios in all of
        them: of those whose ratio in this frame, `alone`, comes near the best."""
        views = self._views
        near = [ratio > max(alone) - views.config.worth for ratio in alone]
        placed = [
            self._nearer(each) if asked else each for each, asked in zip(placed, near, strict=True)
        ]
        asked_ratios = [
            self._log_likelihood(each.model, each.T_cam_model) - other_size(each, self._config)
            if asked
            else -np.inf
            for each, asked in zip(placed, near, strict=True)
        ]
        # The others stay as far behind as they were.
        gained = max(asked_ratios) - max(alone)
        joint = [
            ratio if asked else before + gained
            for ratio, before, asked in zip(asked_ratios, alone, near, strict=True)
        ]
        return placed, joint

    def _nearer(self, each: Hypothesis) -> Hypothesis:
        wave = self._scene.image.wave
        return refined(each, self._verifier, wave, self._config, self._views.rays())

    def _nearer_if_better(self, each: Hypothesis) -> Hypothesis:
        """The placement brought to the edges of the mask, unless its alignment score falls by
        that."""
        search, nearer = self._config.search, self._nearer(each)
        before, after = self._verifier.score(
            np.stack([each.T_cam_model, nearer.T_cam_model]),
            each.model,
            search.alignment_score,
            model_points=search.fine_points,
            seen_points=search.fine_points,
        )
        if after < before:
            return each
        return replace(nearer, alignment_score=each.alignment_score + float(after - before))

    def _turned_by_print(self, each: Hypothesis) -> Hypothesis:
        search, sensor, verifier = self._config.search, self._config.sensor, self._verifier
        free = replace(sensor, pose_turn=search.by_print.turn, pose_shift=search.by_print.shift)

        def covariance(T_cam_model: Array) -> Array:
            return pose_covariance(
                T_cam_model,
                each.model,
                verifier.points,
                self._scene.image.wave,
                free,
                self._views.points(),
                mask=verifier.mask,
            )

        return turned_by_print(
            each,
            self._every_view,
            sensor.patch,
            search,
            partial(self._log_likelihood, each.model, asks_colour=False),
            self._nearer,
            covariance,
        )

    def _as_printed(self, model: Model, T_cam_model: Array) -> float:
        """Of a placement, against that it is none of the stored objects, nats, in all views of it:
        with the votes of its print, which tell turns apart more finely than the likelihood's
        colour."""
        search = self._config.search
        if not search.by_print.asked:
            return self._log_likelihood(model, T_cam_model)
        printed = joint_print_nats(T_cam_model[None], model, self._every_view, search)
        other = self._log_likelihood(model, T_cam_model, asks_colour=False)
        return other + float(printed[0])

    def _log_likelihood(
        self, model: Model, T_cam_model: Array, *, asks_colour: bool = True
    ) -> float:
        """Of a placement, against that it is none of the stored objects, nats, in all views of it;
        with its print or without."""
        return joint_log_likelihood(
            T_cam_model, model, self._every_view, self._config, asks_colour=asks_colour
        )
