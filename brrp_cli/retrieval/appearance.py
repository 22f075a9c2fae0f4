"""Retrieval by what objects look like: colour, shape and metric size, without a network.

Stored objects were looked at from all around when the prior was built. What is seen of an object is
compared with every stored view in many lights, and with the stored object's size in its resting
poses. The objects that are most alike are then laid over what is seen. Probabilities need not sum
to 1: the rest is the probability that the prior does not hold the object. The numbers are in
brrp_cli/config/retrieval.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import Config, HypothesesConfig
from brrp_cli.config.retrieval import FusionConfig
from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.observation.sensor_noise import wave_deviation
from brrp_cli.observation.strays import without_strays
from brrp_cli.observation.support_plane import Plane
from brrp_cli.prior.store import Prior
from brrp_cli.retrieval.aligned import Aligner
from brrp_cli.retrieval.illuminants import lights, local_lights, log_prior
from brrp_cli.retrieval.observed_appearance import see_object
from brrp_cli.retrieval.score_fusion import Similarity, believe
from brrp_cli.retrieval.shortlist import Shortlist, kinds
from brrp_cli.retrieval.similarity import lit_histograms, similarity


class AppearanceRetriever:
    """P(c|R) from colour, shape and size.

    The objects of a frame are judged together, since one light falls on all of them: the first
    question about a frame costs as much as all of its objects, the others cost nothing. `aligns`
    tells whether objects are laid over what is seen, as they are in large priors.
    """

    name = "appearance"

    def __init__(self, prior: Prior, config: Config, seed: int) -> None:
        self._looks = prior.appearance
        self._config = config
        own = config.retrieval
        self._shortlist = Shortlist(self._looks.first, own)
        self._seed = seed
        self._gains = lights(own.illuminants)
        self._light = log_prior(self._gains, own.illuminants)
        self._local = local_lights(self._gains, own.illuminants)
        self._names = prior.names
        self._aligner = Aligner(prior, own.alignment)
        self.aligns = len(prior.names) >= own.alignment.from_objects
        self._similarity = own.similarity
        if not self.aligns:
            self._similarity = replace(own.similarity, blur=0.0, size_most=np.inf)
        # The paper's preset has no numbers of its own for the sensor.
        hypotheses = config.hypotheses or HypothesesConfig()
        self._sensor = hypotheses.sensor
        self._frame: Frame | None = None
        self._answers: dict[int, NDArray[np.float64]] = {}
        self._hasty = False
        # What was seen of a mask of the present image, by its bytes and whether that was in haste.
        self._seen: dict[tuple[bytes, bool], Similarity] | None = None
        self._plane: Plane | None = None

    @contextmanager
    def one_image(self) -> Iterator[None]:
        """See retrieval/base.py."""
        self._seen, self._frame = {}, None
        try:
            yield
        finally:
            self._seen = self._frame = self._plane = None

    @contextmanager
    def hasty(self) -> Iterator[None]:
        """See retrieval/base.py."""
        self._hasty = True
        try:
            yield
        finally:
            self._hasty, self._frame = False, None

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object of the frame, in the order of the prior's names; sum <= 1."""
        if frame is not self._frame:
            # Of masks that are tried, only the one that is asked about is looked at.
            found = self.evidence(frame, [object_id] if self._hasty else None)
            own = self._config.retrieval
            weights = own.fusion if self.aligns else own.likeness
            answers = self._believe(list(found.values()), weights)
            self._answers = dict(zip(found, answers, strict=True))
            self._frame = frame
        if object_id not in self._answers:
            raise RetrievalError(
                "The mask has no such object",
                where=frame.source,
                expected=", ".join(map(str, frame.object_ids)) or "a mask with objects",
                found=object_id,
            )
        return self._answers[object_id]

    def evidence(self, frame: Frame, asked: Sequence[int] | None = None) -> dict[int, Similarity]:
        """How alike every object of the frame is to the stored ones, by id; with `asked`, these and
        those that are known."""
        known = {} if self._seen is None else self._seen
        masks = {i: np.packbits(frame.segmap == i).tobytes() for i in frame.object_ids}
        found = {i: known[mask, False] for i, mask in masks.items() if (mask, False) in known}
        if self._hasty:
            # Not of the others: what was tried before depends on how threads take turns.
            tried = {i: (masks[i], True) for i in asked or masks if i not in found}
            found |= {i: known[key] for i, key in tried.items() if key in known}
        new = [i for i in masks if i not in found and (asked is None or i in asked)]
        looked = self._compared(frame, new)
        known.update({(masks[i], self._hasty): seen for i, seen in looked.items()})
        found |= looked
        return {i: found[i] for i in masks if i in found}

    def _compared(self, frame: Frame, ids: Sequence[int]) -> dict[int, Similarity]:
        # Methods that leave strays out, and those that do not, get the same answer.
        frame = without_strays(frame, self._config.strays)
        plane, own = self.plane(frame), self._config.retrieval
        looks, points = {}, {}
        for object_id in ids:
            seen = see_object(frame, object_id, plane, own.observed)
            histograms = lit_histograms(seen, self._gains)
            rows = self._shortlist.rows(seen, histograms)
            stored = self._looks.rows(rows)
            looks[object_id] = similarity(
                seen, histograms, stored, rows, len(self._gains), self._similarity
            )
            points[object_id] = seen.points
        if not self.aligns:
            return looks
        if plane is None:
            return {i: replace(look, alignment=own.alignment.neutral) for i, look in looks.items()}
        likely = self._believe(list(looks.values()), own.likeness)
        wave = wave_deviation(frame, plane, self._sensor)
        return {
            i: self._aligned(look, probabilities[look.rows], points[i], frame, plane, wave)
            for (i, look), probabilities in zip(looks.items(), likely, strict=True)
        }

    def _aligned(
        self,
        look: Similarity,
        likely: NDArray[np.float64],
        points: NDArray[np.float64],
        frame: Frame,
        plane: Plane,
        wave: float,
    ) -> Similarity:
        """With the alignment scores of the objects that are `likely` (m,) by their looks."""
        own = self._config.retrieval.alignment
        if len(points) < own.least_points:
            return replace(look, alignment=own.neutral)
        alike = np.argsort(-likely, kind="stable")
        alike = alike[likely[alike] > likely.max() * np.exp(-own.margin)]
        ranked = [alike[kind] for kind in kinds(self._shortlist.plain[look.rows[alike]])]
        shuffled = points[np.random.default_rng(self._seed).permutation(len(points))]
        seen = self._aligner.on(shuffled, frame, plane, wave)
        alignment = np.full(len(look.rows), own.unaligned, np.float32)
        rounds = min(own.hasty_rounds, own.rounds) if self._hasty else own.rounds
        for begin in range(0, rounds * own.tried, own.tried):
            # In the prior's order, in which shards hold them.
            tried = np.sort(np.concatenate([kind[begin : begin + own.tried] for kind in ranked]))
            first = seen.first_scores(self._named(look.rows[tried]))
            promise = np.log(likely[tried]) + own.first * first
            order = tried[np.argsort(-promise, kind="stable")]
            for chosen in (order[: own.most], order[own.most : own.most + own.more]):
                found = seen.scores(self._named(look.rows[chosen]))
                alignment[chosen] = np.maximum(found, own.lowest)
                if found.max(initial=0.0) >= own.enough:
                    break
            if alignment.max(initial=0.0) >= own.certain:
                break
        promise = np.log(np.maximum(likely, np.finfo(float).tiny)) + own.first * alignment
        promise[alignment <= own.lowest] = -np.inf
        last = np.argsort(-promise, kind="stable")[: own.last]
        last = np.sort(last[np.isfinite(promise[last])])
        found = seen.last_scores(self._named(look.rows[last]), own.finest)
        alignment[last] = np.maximum(found, own.lowest)
        return replace(look, alignment=alignment, wave=wave)

    def _named(self, rows: NDArray[np.int64]) -> list[str]:
        return [self._names[row] for row in rows]

    def _believe(
        self, evidence: Sequence[Similarity], weights: FusionConfig
    ) -> list[NDArray[np.float64]]:
        return believe(
            evidence,
            self._light,
            self._local,
            len(self._looks),
            weights,
        )

    def plane(self, frame: Frame) -> Plane | None:
        """The support plane of the frame; None where none is found."""
        if self._seen is None:
            return scene_plane(frame, self._config.observation, self._seed)
        if self._plane is None:
            self._plane = scene_plane(frame, self._config.observation, self._seed)
        return self._plane
