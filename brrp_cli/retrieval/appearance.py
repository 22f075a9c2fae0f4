"""Retrieval by what objects look like: colour, shape and metric size, without a network.

Stored objects were looked at from all around when the prior was built. What is seen of an object is
compared with every stored view in many lights, and with the stored object's size in its resting
poses. The objects that are most alike are then laid over what is seen. Probabilities need not sum
to 1: the rest is the probability that the prior does not hold the object. The numbers are in
brrp_cli/config/retrieval.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

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
from brrp_cli.retrieval.base import Each, here
from brrp_cli.retrieval.illuminants import local_lights, log_prior
from brrp_cli.retrieval.score_fusion import Similarity, believe
from brrp_cli.retrieval.steps import SeenImage, Steps, aligned, looked


class AppearanceRetriever:
    """P(c|R) from colour, shape and size.

    The objects of a frame are judged together, since one light falls on all of them: the first
    question about a frame costs as much as all of its objects, the others cost nothing. Stored
    objects are laid over what is seen, so that P(c|R) knows the depth: `aligns`.
    """

    name = "appearance"
    sendable = True
    aligns = True

    def __init__(self, prior: Prior, config: Config, seed: int, steps: Steps | None = None) -> None:
        self._steps = steps or Steps(prior, config, seed)
        self._made_of = prior, config, seed
        self._light = log_prior(self._steps.gains, config.retrieval.illuminants)
        self._local = local_lights(self._steps.gains, config.retrieval.illuminants)
        self._frame: Frame | None = None
        self._answers: dict[int, NDArray[np.float64]] = {}
        self._hasty = False
        self._each: Each = here
        # What was seen of a mask of the present image, by its bytes and whether that was in haste.
        self._seen: dict[tuple[bytes, bool], Similarity] | None = None
        self._table: tuple[Plane | None, float] | None = None

    def __reduce__(self) -> tuple[Callable[..., AppearanceRetriever], tuple[Any, ...]]:
        seen = None
        if self._seen is not None:
            seen = {key: found for key, found in self._seen.items() if not key[1]}
        return _received, (*self._made_of, self._steps, seen, self._table, self._hasty)

    @contextmanager
    def one_image(self) -> Iterator[None]:
        """See retrieval/base.py."""
        self._seen, self._frame = {}, None
        try:
            yield
        finally:
            self._seen = self._frame = self._table = None

    @contextmanager
    def hasty(self) -> Iterator[None]:
        """See retrieval/base.py."""
        self._hasty = True
        try:
            yield
        finally:
            self._hasty, self._frame = False, None

    @contextmanager
    def helped(self, each: Each) -> Iterator[None]:
        """See retrieval/base.py."""
        self._each = each
        try:
            yield
        finally:
            self._each = here

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object of the frame, in the order of the prior's names; sum <= 1."""
        if frame is not self._frame:
            # Of masks that are tried, only the one that is asked about is looked at.
            found = self.evidence(frame, [object_id] if self._hasty else None)
            answers = self._believe(list(found.values()), self._made_of[1].retrieval.fusion)
            self._answers = dict(zip(found, answers, strict=True))
            self._frame = frame
        if object_id not in self._answers:
            raise RetrievalError(
                "The mask has no such object",
                where=frame.source,
                expected=", ".join(map(str, frame.object_ids)) or "a mask with objects",
                found=object_id,
                fix="take an id of frame.object_ids",
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
        compared = self._compared(frame, new) if new else {}
        known.update({(masks[i], self._hasty): seen for i, seen in compared.items()})
        found |= compared
        return {i: found[i] for i in masks if i in found}

    def _compared(self, frame: Frame, ids: Sequence[int]) -> dict[int, Similarity]:
        # Methods that leave strays out, and those that do not, get the same answer.
        frame = without_strays(frame, self._made_of[1].strays)
        plane, wave = self._seen_table(frame)
        image = SeenImage(self._steps, frame, plane, wave)
        found = self._each(looked, image, [(object_id,) for object_id in ids])
        looks = [look for look, _ in found]
        likely = self._believe(looks, self._made_of[1].retrieval.likeness)
        asked = [
            (object_id, look, probabilities[look.rows], points, self._hasty)
            for object_id, (look, points), probabilities in zip(ids, found, likely, strict=True)
        ]
        return dict(zip(ids, self._each(aligned, image, asked), strict=True))

    def _believe(
        self, evidence: Sequence[Similarity], weights: FusionConfig
    ) -> list[NDArray[np.float64]]:
        count = len(self._made_of[0].names)
        return believe(evidence, self._light, self._local, count, weights)

    def _seen_table(self, frame: Frame) -> tuple[Plane | None, float]:
        """The support plane of the frame, None where none is found, and how its depth errs over
        patches; of one image, what its first frame shows."""
        if self._table is not None:
            return self._table
        _, config, seed = self._made_of
        plane, wave = scene_plane(frame, config.observation, seed), 0.0
        if plane is not None:
            # The paper's preset has no numbers of its own for the sensor.
            hypotheses = config.hypotheses or HypothesesConfig()
            wave = wave_deviation(frame, plane, hypotheses.sensor)
        if self._seen is not None:
            self._table = plane, wave
        return plane, wave


def _received(
    prior: Prior,
    config: Config,
    seed: int,
    steps: Steps,
    seen: dict[tuple[bytes, bool], Similarity] | None,
    table: tuple[Plane | None, float] | None,
    hasty: bool,
) -> AppearanceRetriever:
    """In another process, with what was seen of the present image."""
    retriever = AppearanceRetriever(prior, config, seed, steps)
    retriever._seen, retriever._table, retriever._hasty = seen, table, hasty
    return retriever
