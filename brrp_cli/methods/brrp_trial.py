"""Which stored objects lie in masks that may be one object's: placed and weighed, not inferred."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import Config
from brrp_cli.frames.frame import Frame
from brrp_cli.methods.base import Setup, Trial
from brrp_cli.methods.brrp_default import reconstruct_by_hypotheses
from brrp_cli.methods.each_object import guarded, too_few
from brrp_cli.methods.scene import SeenScene, look_at
from brrp_cli.methods.shared_work import shared_work
from brrp_cli.observation.ray_samples import without_samples
from brrp_cli.observation.strays import without_strays
from brrp_cli.reconstruction import OK, ObjectReconstruction
from brrp_cli.retrieval.base import Retriever, hasty, sendable, unknown
from brrp_cli.retrieval.checked import CheckedRetriever
from brrp_cli.threads import cores, in_threads


@dataclass(frozen=True)
class _Tries:
    """scene : of the frame as it is; tried_id : of what is tried, which no object has; retriever :
    for whoever tries a mask, None where it cannot be sent"""

    scene: SeenScene
    trial: Trial
    tried_id: int
    retriever: Retriever | None


def try_masks(frame: Frame, setup: Setup, trial: Trial) -> list[ObjectReconstruction]:
    """What each mask is taken for, numbered from 0, without posteriors and surfaces; of the preset
    `paper`, which weighs no placements, nothing is told."""
    config, prior = setup.config, setup.prior
    assert isinstance(config, Config) and prior is not None and setup.retriever is not None
    if config.hypotheses is None:
        return [ObjectReconstruction(number, OK) for number in range(len(trial.masks))]
    retriever = CheckedRetriever(setup.retriever, len(prior.names))
    frame = without_strays(frame, config.strays, ())
    # A mask that is tried takes little from the background, if anything.
    scene = look_at(frame, setup, retriever, shapes=False)
    sent = retriever if sendable(setup.retriever) else None
    tries = _Tries(scene, trial, int(frame.segmap.max()) + 1, sent)

    with hasty(setup.retriever), shared_work(_tried, tries, scene, setup.helpers) as work:

        def one(number: int) -> ObjectReconstruction:
            if sent is not None:
                return work(number)
            frame = _tried_frame(tries, number)
            if len(frame.object_points(tries.tried_id)) < config.observation.min_points:
                return work(number)
            return work(number, retriever.probabilities(frame, tries.tried_id))

        def whole(number: int) -> ObjectReconstruction:
            return guarded(number, partial(one, number), logging.DEBUG)

        return list(in_threads(whole, range(len(trial.masks)), setup.workers or cores()))


def _tried_frame(tries: _Tries, number: int) -> Frame:
    """The frame with one of the masks in the place of its own."""
    scene, tried_id = tries.scene, tries.tried_id
    measured, hypotheses = scene.measured, scene.config.hypotheses
    assert hypotheses is not None
    segmap = np.where(tries.trial.masks[number], tried_id, measured.segmap)
    frame = without_strays(measured.with_masks(segmap), scene.config.strays, (), [tried_id])
    return scene.image.mended(frame, hypotheses, tried_id)


def _tried(
    tries: _Tries, number: int, probabilities: NDArray[np.float64] | None = None
) -> ObjectReconstruction:
    """What one mask is taken for; `probabilities` (n,) where they are known."""
    scene, config = tries.scene, tries.trial.config
    frame = _tried_frame(tries, number)
    count, least = len(frame.object_points(tries.tried_id)), scene.config.observation.min_points
    if count < least:
        return too_few(number, count, least)
    if probabilities is None:
        assert tries.retriever is not None
        probabilities = tries.retriever.probabilities(frame, tries.tried_id)
    missing = unknown(probabilities)
    if missing > config.most_missing:
        return ObjectReconstruction(number, OK, unknown_probability=missing, unknown_weight=1.0)
    observation = without_samples(frame, tries.tried_id)
    scene = replace(scene, frame=frame)
    item = reconstruct_by_hypotheses(scene, observation, probabilities, trial=config)
    return replace(item, object_id=number)
