"""BRRP: retrieve, register, infer. Two presets: `default`, and `paper` as the paper has it."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from brrp_cli.config import PRESETS, Config
from brrp_cli.methods.base import Method, Setup, Trial
from brrp_cli.methods.configuration import as_record

if TYPE_CHECKING:
    from brrp_cli.frames.frame import Frame
    from brrp_cli.prior.store import Prior
    from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction, StoredPosterior


def run(frame: Frame, setup: Setup) -> Reconstruction:
    """Every object of a frame, as the configuration says. The same seed gives the same bytes,
    whatever the number of workers, and with helpers or without."""
    from brrp_cli.device import pick_device
    from brrp_cli.methods.brrp_objects import by_hypotheses
    from brrp_cli.methods.brrp_paper import reconstruct_object
    from brrp_cli.methods.each_object import share_retrieval, too_few, with_surface
    from brrp_cli.methods.scene import look_at
    from brrp_cli.observation.ray_samples import sampled_scene
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
    with ExitStack() as stack:
        infer: Callable[[int], ObjectReconstruction]
        if config.hypotheses is not None:
            scene = look_at(frame, setup, retriever)
            frame, image = scene.frame, scene.image
            # A stored object may be placed by its mask: see `hypotheses.mask`.
            least = replace(config.observation, min_points=config.hypotheses.mask.least_points)
            sampled = sampled_scene(frame, least, seed, image.plane)
            infer = stack.enter_context(by_hypotheses(scene, sampled, retriever, setup))
        else:
            image, sampled = None, sampled_scene(frame, config.observation, seed)

            def infer(object_id: int) -> ObjectReconstruction:
                def one() -> ObjectReconstruction:
                    observation = sampled.observation(object_id)
                    return reconstruct_object(
                        frame, observation, prior, retriever, config, seed=seed, device=device
                    )

                return with_surface(object_id, one, config.surface)

        seconds = {"observation": time.perf_counter() - start}

        def whole(object_id: int) -> ObjectReconstruction:
            if object_id in sampled.too_few:
                count = sampled.too_few[object_id]
                return too_few(object_id, count, config.observation.min_points)
            return infer(object_id)

        ids = [i for i in frame.object_ids if setup.only is None or i in setup.only]
        objects = list(progress(in_threads(whole, ids, workers), "objects", len(ids)))
    share_retrieval(objects, retriever.seconds)
    return Reconstruction(
        frame=given,
        objects=objects,
        plane=sampled.plane,
        method=METHOD.name,
        retriever=retriever.name,
        prior_path=prior.path,
        prior_digest=prior.digest,
        configuration=as_record(config),
        seed=seed,
        device=device,
        seconds=seconds,
        image=image,
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
    takes_helpers=True,
)
