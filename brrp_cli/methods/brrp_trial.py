"""Which stored objects lie in masks that may be one object's: placed and weighed, not inferred."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import Config
from brrp_cli.device import pick_device
from brrp_cli.frames.frame import Frame
from brrp_cli.methods.base import Setup, Trial
from brrp_cli.methods.brrp_default import reconstruct_by_hypotheses
from brrp_cli.methods.each_object import too_few, with_surface
from brrp_cli.observation.pixel_noise import pixel_noise
from brrp_cli.observation.ray_samples import scene_plane, without_samples
from brrp_cli.observation.sensor_noise import wave_deviation
from brrp_cli.observation.strays import without_strays
from brrp_cli.reconstruction import OK, ObjectReconstruction
from brrp_cli.retrieval.base import hasty
from brrp_cli.retrieval.checked import CheckedRetriever
from brrp_cli.threads import cores, in_threads


def try_masks(frame: Frame, setup: Setup, trial: Trial) -> list[ObjectReconstruction]:
    """What each mask is taken for, numbered from 0, without posteriors and surfaces; of the preset
    `paper`, which weighs no placements, nothing is told."""
    config, prior, seed = setup.config, setup.prior, setup.seed
    assert isinstance(config, Config) and prior is not None and setup.retriever is not None
    hypotheses = config.hypotheses
    if hypotheses is None:
        return [ObjectReconstruction(number, OK) for number in range(len(trial.masks))]
    retriever = CheckedRetriever(setup.retriever, len(prior.names))
    frame = without_strays(frame, config.strays, ())
    # A mask that is tried takes little from the background, if anything.
    plane = scene_plane(frame, config.observation, seed)
    wave = wave_deviation(frame, plane, hypotheses.sensor)
    noise = pixel_noise(frame, plane, hypotheses.sensor)
    tried_id = int(frame.segmap.max()) + 1
    least, device = config.observation.min_points, pick_device(setup.device)

    def one(mask: NDArray[np.bool_]) -> ObjectReconstruction:
        tried = replace(frame, segmap=np.where(mask, tried_id, frame.segmap))
        tried = without_strays(tried, config.strays, (), [tried_id])
        count = len(tried.object_points(tried_id))
        if count < least:
            return too_few(tried_id, count, least)
        return reconstruct_by_hypotheses(
            tried,
            plane,
            wave,
            noise,
            without_samples(tried, tried_id),
            prior,
            retriever,
            config,
            seed=seed,
            device=device,
            trial=trial.config,
        )

    def whole(number: int) -> ObjectReconstruction:
        infer = partial(one, trial.masks[number])
        found = with_surface(number, infer, config.surface, logging.DEBUG)
        return replace(found, object_id=number)

    with hasty(setup.retriever):
        return list(in_threads(whole, range(len(trial.masks)), setup.workers or cores()))
