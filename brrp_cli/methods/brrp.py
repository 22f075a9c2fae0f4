"""BRRP: retrieve, register, infer. Two presets: `default`, and `paper` as the paper has it."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING

from brrp_cli.config import PRESETS, Config
from brrp_cli.methods.base import Method, Setup, Trial
from brrp_cli.methods.configuration import as_record

if TYPE_CHECKING:
    from brrp_cli.frames.frame import Frame
    from brrp_cli.observation.ray_samples import ObjectObservation
    from brrp_cli.prior.store import Prior
    from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction, StoredPosterior


def run(frame: Frame, setup: Setup) -> Reconstruction:
    """Every object of a frame, as the configuration says. The same seed gives the same bytes,
    whatever the number of workers."""
    from brrp_cli.device import pick_device
    from brrp_cli.methods.brrp_default import reconstruct_by_hypotheses
    from brrp_cli.methods.brrp_paper import reconstruct_object
    from brrp_cli.methods.each_object import too_few, with_surface
    from brrp_cli.methods.earlier_views import EarlierViews
    from brrp_cli.observation.pixel_noise import pixel_noise
    from brrp_cli.observation.ray_samples import observe
    from brrp_cli.observation.sensor_noise import wave_deviation
    from brrp_cli.observation.strays import without_strays
    from brrp_cli.progress import progress
    from brrp_cli.reconstruction import Reconstruction
    from brrp_cli.retrieval.checked import CheckedRetriever
    from brrp_cli.threads import cores, in_threads

    config, prior, seed = setup.config, setup.prior, setup.seed
    assert isinstance(config, Config) and prior is not None and setup.retriever is not None
    device = pick_device(setup.device)
    retriever = CheckedRetriever(setup.retriever, len(prior.names))
    workers = setup.workers or cores()
    start = time.perf_counter()
    given = frame
    if config.hypotheses is not None:
        frame = without_strays(frame, config.strays, setup.only)
    scene = observe(frame, config.observation, seed, workers)
    if config.hypotheses is not None:
        wave = wave_deviation(frame, scene.plane, config.hypotheses.sensor)
        noise = pixel_noise(frame, scene.plane, config.hypotheses.sensor)
    seconds = {"observation": time.perf_counter() - start}

    def one(observation: ObjectObservation) -> ObjectReconstruction:
        if config.hypotheses is None:
            return reconstruct_object(
                frame, observation, prior, retriever, config, seed=seed, device=device
            )
        earlier = None
        if setup.stream is not None:
            earlier = EarlierViews.of(
                setup.stream.earlier.get(observation.object_id, ()), setup.stream.config
            )
        return reconstruct_by_hypotheses(
            frame,
            scene.plane,
            wave,
            noise,
            observation,
            prior,
            retriever,
            config,
            seed=seed,
            device=device,
            earlier=earlier,
        )

    def whole(object_id: int) -> ObjectReconstruction:
        if object_id in scene.too_few:
            return too_few(object_id, scene.too_few[object_id], config.observation.min_points)
        return with_surface(object_id, partial(one, scene.objects[object_id]), config.surface)

    ids = [i for i in frame.object_ids if setup.only is None or i in setup.only]
    return Reconstruction(
        frame=given,
        objects=list(progress(in_threads(whole, ids, workers), "objects", len(ids))),
        plane=scene.plane,
        method=METHOD.name,
        retriever=retriever.name,
        prior_path=prior.path,
        prior_digest=prior.digest,
        configuration=as_record(config),
        seed=seed,
        device=device,
        seconds=seconds,
    )


def posteriors() -> tuple[type[StoredPosterior], ...]:
    """Of the preset `paper`, and of `default`."""
    from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
    from brrp_cli.inference.posterior import HilbertPosterior

    return HilbertPosterior, HypothesisPosterior


def _check_prior(prior: Prior, config: Config) -> None:
    from brrp_cli.methods.check_prior import check_prior

    check_prior(prior, config)


def _try_masks(frame: Frame, setup: Setup, trial: Trial) -> list[ObjectReconstruction]:
    from brrp_cli.methods.brrp_trial import try_masks

    return try_masks(frame, setup, trial)


METHOD = Method(
    name="brrp",
    summary="retrieval, registration and inference with a prior of known objects",
    presets=PRESETS,
    run=run,
    posteriors=posteriors,
    uses_prior=True,
    uses_retriever=True,
    check_prior=_check_prior,
    try_masks=_try_masks,
    uses_cuda=True,
    object_by_object=True,
)
