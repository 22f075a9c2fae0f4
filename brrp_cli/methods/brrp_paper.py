"""BRRP as the paper has it: retrieve, register, infer (section IV)."""

from __future__ import annotations

import numpy as np

from brrp_cli.config import Config
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.inference.infer import LabelledPoints, infer_posterior
from brrp_cli.observation.ray_samples import ObjectObservation
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import OK, ObjectReconstruction, Retrieved
from brrp_cli.registration.scale_scan import ObservedCloud, observed_cloud, register
from brrp_cli.retrieval.base import Retriever, top_k, unknown
from brrp_cli.seeds import child_seed
from brrp_cli.timing import timed


def reconstruct_object(
    frame: Frame,
    observation: ObjectObservation,
    prior: Prior,
    retriever: Retriever,
    config: Config,
    *,
    seed: int,
    device: str,
) -> ObjectReconstruction:
    """Posterior of one object from its observed samples and the k retrieved objects.

    A retrieved object that cannot be registered drops out of the mixture; when none is left the
    posterior rests on the observation alone, and `message` says so.
    """
    seconds: dict[str, float] = {}
    object_id = observation.object_id
    probabilities = retriever.probabilities(frame, object_id)
    chosen = top_k(probabilities, prior.names, config.k)
    with timed(seconds, "registration"):
        observed = observed_cloud(observation.points, config.features)
        placed = [
            _place(prior.load(name), probability, observed, config, child_seed(seed, object_id))
            for name, probability in chosen
        ]
    components = [
        (_prior_samples(stored, found), found.probability)
        for stored, found in placed
        if found.T_cam_object is not None
    ]
    with timed(seconds, "inference"):
        posterior = infer_posterior(
            LabelledPoints(observation.samples, observation.labels),
            [samples for samples, _ in components],
            [probability for _, probability in components],
            observation.center,
            config.inference,
            reach=config.observation.ray_radius,
            seed=child_seed(seed, "svgd", object_id),
            device=device,
        )
    return ObjectReconstruction(
        object_id=object_id,
        status=OK,
        message="" if components else "no retrieved object could be registered; no prior used",
        n_points=len(observation.points),
        center=observation.center,
        observed=observation.points,
        retrieved=[found for _, found in placed],
        unknown_probability=unknown(probabilities),
        posterior=posterior,
        seconds=seconds,
    )


def _place(
    stored: PriorObject, probability: float, observed: ObservedCloud, config: Config, seed: int
) -> tuple[PriorObject, Retrieved]:
    placement = register(observed, stored, config.features, config.registration, seed)
    if placement is None:
        return stored, Retrieved(stored.name, probability)
    return stored, Retrieved(
        stored.name,
        probability,
        placement.T_cam_object,
        *stored.mesh_pose(placement.T_cam_object),
        placement.inliers,
        placement.fitness,
    )


def _prior_samples(stored: PriorObject, found: Retrieved) -> LabelledPoints:
    """The stored samples where registration put the object, metres, camera frame."""
    assert found.T_cam_object is not None
    points = transform_points(found.T_cam_object, stored.samples.astype(np.float64))
    return LabelledPoints(points, stored.labels)
