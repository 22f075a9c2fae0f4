"""A whole frame, object after object."""

from __future__ import annotations

import time

import numpy as np

from brrp_cli.config import Config
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.observation.ray_samples import observe
from brrp_cli.prior.store import Prior
from brrp_cli.retrieval.base import Retriever, top_k
from plain.registration import register
from plain.surface import surface
from plain.svgd import infer

STAGES = ("retrieval", "registration", "inference", "surface")


def reconstruct_plainly(
    frame: Frame,
    prior: Prior,
    retriever: Retriever,
    config: Config,
    *,
    seed: int = 0,
    objects: int | None = None,
) -> tuple[float, list[dict[str, float]]]:
    """Seconds of the observation, and for each object (the first `objects` of them) seconds of each
    stage. Observation and retrieval are brrp's own."""
    clock = time.perf_counter
    start = clock()
    scene = observe(frame, config.observation, seed)
    observation = clock() - start
    spent = []
    for seen in list(scene.objects.values())[:objects]:
        times = [clock()]
        chosen = top_k(retriever.probabilities(frame, seen.object_id), prior.names, config.k)
        times.append(clock())
        components, shares = [], []
        for name, probability in chosen:
            stored = prior.load(name)
            T_cam_object = register(seen.points, stored, config)
            if T_cam_object is not None:
                placed = transform_points(T_cam_object, stored.samples.astype(np.float64))
                components.append((placed, stored.labels))
                shares.append(probability)
        times.append(clock())
        particles = infer(
            (seen.samples, seen.labels), components, shares, seen.center, config.inference, seed
        )
        times.append(clock())
        surface(particles, config.inference, config.surface.level)
        times.append(clock())
        spent.append(dict(zip(STAGES, np.diff(times).tolist(), strict=True)))
    return observation, spent
