"""Retrieval without a model: every stored object is tried on, and how well it fits is its score.

What it does, honestly: it places each stored object, in its true size, on the observed points from
a few starts, refines each and scores the best by the share of observed points that the placed
model explains less the share of the model that stands in space seen to be free. It sees shape and
size, no colour; its probabilities are a softmax of that score and are not calibrated; and its cost
grows with the prior, about a tenth of a second for each pair of a stored and a seen object. For a
prior of hundreds of objects use CLIP.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import Config
from brrp_cli.descriptors.fpfh import FeatureCloud
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import normalise, similarity, transform_points
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.store import Prior
from brrp_cli.registration.evidence import contradicted, explained
from brrp_cli.registration.ransac import match_repeatedly
from brrp_cli.registration.refine import refine
from brrp_cli.registration.scale_scan import ObservedCloud, observed_cloud
from brrp_cli.retrieval.base import softmax
from brrp_cli.seeds import child_seed

# Feature matchings for each stored object, and draws in each: the score ranks, it does not place.
STARTS = 3
ITERATIONS = 10_000
# How far apart observed points and model may lie to be pulled together, and to agree, metres.
REFINE_DISTANCE = 0.02
TOLERANCE = 0.005
# Score difference that makes one object e times as probable as another.
TEMPERATURE = 0.05
# Model points that are compared with the image.
MODEL_POINTS = 1000
# Above this size the user is told what the wait is for.
SMALL_PRIOR = 200

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Candidate:
    """A stored object, metres, about the middle of its box.

    cloud : features at the scale of the scan nearest to the true size; surface, normals : (n, 3),
    in the true size.
    """

    name: str
    cloud: FeatureCloud
    surface: NDArray[np.float64]
    normals: NDArray[np.float64]


class FitnessRetriever:
    """P(c|R) from how well each object of a small prior can be made to fit."""

    name = "fitness"

    def __init__(self, prior: Prior, config: Config, seed: int) -> None:
        if len(prior.names) > SMALL_PRIOR:
            log.warning(
                "Retrieval by fitness tries all %d objects of the prior on every seen object; "
                "--clip-dir names a CLIP model that does not have to",
                len(prior.names),
            )
        self._config = config
        self._matching = replace(config.registration, iterations=ITERATIONS)
        self._seed = seed
        self._candidates = [_candidate(prior.load(name), config) for name in prior.names]

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object of the frame, in the order of the prior's names."""
        observed = observed_cloud(frame.object_points(object_id), self._config.features)
        scores = [self._score(candidate, observed, frame) for candidate in self._candidates]
        return softmax(np.array(scores) / TEMPERATURE)

    def _score(self, candidate: _Candidate, observed: ObservedCloud, frame: Frame) -> float:
        """Explained less contradicted, in [-1, 1], of the best start."""
        best = -1.0
        refined = refine(
            np.stack(self._starts(candidate, observed)),
            observed.cloud.points,
            candidate.surface,
            candidate.normals,
            REFINE_DISTANCE,
        )
        for T_center_model in refined:
            model = transform_points(T_center_model, candidate.surface) + observed.center
            seen = observed.cloud.points + observed.center
            against = contradicted(model[:MODEL_POINTS], frame, TOLERANCE)
            best = max(best, explained(seen, model, TOLERANCE) - against)
        return best

    def _starts(self, candidate: _Candidate, observed: ObservedCloud) -> list[NDArray[np.float64]]:
        """T_center_model of each start: matched features, and the model just behind its front.

        What has no features to match, a ball, needs no turning either.
        """
        behind = normalise(observed.center) * np.ptp(candidate.surface, axis=0).mean() / 4
        starts = [similarity(translation=behind)]
        seeds = [child_seed(self._seed, "fitness", candidate.name, n) for n in range(STARTS)]
        matches = match_repeatedly(candidate.cloud, observed.cloud, self._matching, seeds)
        return starts + [found.T_target_source for found in matches if found is not None]


def _candidate(stored: PriorObject, config: Config) -> _Candidate:
    features = config.features
    nearest = min(
        features.scales,
        key=lambda scale: abs(np.log(scale * features.base_scale / stored.half_extent)),
    )
    return _Candidate(
        stored.name,
        stored.clouds[nearest],
        stored.surface.astype(np.float64) * stored.half_extent,
        stored.surface_normals.astype(np.float64),
    )
