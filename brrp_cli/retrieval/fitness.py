"""Retrieval without a model: every stored object is tried on, and how well it fits is its score.

What it does, honestly: it registers each stored object, near its true size, to the observed points
and scores the share of observed points that the placed model explains less the share of the model
that stands in space seen to be free. It sees shape and size, no colour; its probabilities are a
softmax of that score and are not calibrated; and its cost grows with the prior, about a tenth of a
second for each pair of a stored and a seen object. For a prior of hundreds of objects use CLIP.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import Config
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.store import Prior
from brrp_cli.registration.evidence import contradicted, explained
from brrp_cli.registration.scan import ObservedCloud, observed_cloud, register
from brrp_cli.retrieval.base import softmax

# Far fewer draws than the placement that follows: the score ranks, it does not place.
ITERATIONS = 20_000
# How far a placed model may lie from the depth image before it counts against it, metres.
TOLERANCE = 0.0075
# Score difference that makes one object e times as probable as another.
TEMPERATURE = 0.05
# Model points that are compared with the image.
MODEL_POINTS = 1000
# Above this size the user is told what the wait is for.
SMALL_PRIOR = 200

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Candidate:
    """A stored object with the one scale that is nearest to its true size."""

    stored: PriorObject
    scale: float


class FitnessRetriever:
    """P(c|R) from registration fitness over all objects of a small prior."""

    name = "fitness"

    def __init__(self, prior: Prior, config: Config, seed: int) -> None:
        if len(prior.names) > SMALL_PRIOR:
            log.warning(
                "Retrieval by fitness tries all %d objects of the prior on every seen object; "
                "--clip-dir names a CLIP model that does not have to",
                len(prior.names),
            )
        self._config = config
        self._seed = seed
        self._candidates = [_candidate(prior.load(name), config) for name in prior.names]

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object of the frame, in the order of the prior's names."""
        observed = observed_cloud(frame.object_points(object_id), self._config.features)
        scores = [self._score(candidate, observed, frame) for candidate in self._candidates]
        return softmax(np.array(scores) / TEMPERATURE)

    def _score(self, candidate: _Candidate, observed: ObservedCloud, frame: Frame) -> float:
        """Explained less contradicted, in [-1, 1]; -1 when nothing matches at all."""
        placement = register(
            observed,
            candidate.stored,
            self._config.features,
            replace(self._config.registration, iterations=ITERATIONS),
            self._seed,
            scales=[candidate.scale],
        )
        if placement is None:
            return -1.0
        model = transform_points(placement.T_cam_object, candidate.stored.surface)
        seen = observed.cloud.points + observed.center
        against = contradicted(model[:MODEL_POINTS], frame, TOLERANCE)
        return explained(seen, model, TOLERANCE) - against


def _candidate(stored: PriorObject, config: Config) -> _Candidate:
    """The scale of the scan nearest to the object's true size; other clouds are let go."""
    features = config.features
    scale = min(
        features.scales,
        key=lambda s: abs(np.log(s * features.base_scale / stored.half_extent)),
    )
    return _Candidate(replace(stored, clouds={scale: stored.clouds[scale]}), scale)
