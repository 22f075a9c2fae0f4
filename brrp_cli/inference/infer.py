"""From samples to a posterior: one object, mini-batched SVGD (paper, section IV-D)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from brrp_cli.config import InferenceConfig
from brrp_cli.inference.density import Lambdas, Samples, log_density
from brrp_cli.inference.hinge import HingeGrid, cubic_grid, features
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.inference.svgd import run_svgd


@dataclass(frozen=True)
class LabelledPoints:
    """points : (n, 3), metres, camera frame; labels : (n,) bool, True = occupied."""

    points: NDArray[np.floating]
    labels: NDArray[np.bool_]


def hinge_grid(config: InferenceConfig) -> HingeGrid:
    """The grid of hinge points that a configuration asks for."""
    return cubic_grid(config.hinges_per_axis, config.hinge_half_width, config.feature_floor)


def infer_posterior(
    observed: LabelledPoints,
    components: list[LabelledPoints],
    probabilities: list[float],
    center: NDArray[np.floating],
    config: InferenceConfig,
    *,
    reach: float,
    seed: int,
    device: str = "cpu",
) -> HilbertPosterior:
    """Infer the weights of one object's map from observed samples and registered prior samples.

    components : samples of the registered objects, at equal sizes; probabilities : P(c|R) of each.
    No component leaves the posterior to the observation alone. center : (3,), metres, camera
    frame, where the hinge grid stands. The same seed gives the same particles.
    """
    grid = hinge_grid(config)
    generator = torch.Generator().manual_seed(seed)
    observed_phi = features(_local(observed.points, center, device), grid)
    observed_labels = _labels(observed.labels, device)
    prior_points = [_local(component.points, center, device) for component in components]
    prior_labels = [_labels(component.labels, device) for component in components]
    log_probabilities = _log_weights(probabilities, device) if components else None
    lambdas = Lambdas(config.lambda_observed, config.lambda_prior, config.lambda_norm)
    count = len(observed.points)
    batches = math.ceil(count / config.observed_batch)
    order = torch.randperm(count, generator=generator).to(device)

    def score(particles: Tensor, step: int) -> Tensor:
        nonlocal order
        if step % batches == 0:
            order = torch.randperm(count, generator=generator).to(device)
        start = step % batches * config.observed_batch
        rows = order[start : start + config.observed_batch]
        prior = None
        if components:
            picks = [
                torch.randint(len(points), (config.prior_batch,), generator=generator).to(device)
                for points in prior_points
            ]
            drawn = torch.stack([p[i] for p, i in zip(prior_points, picks, strict=True)])
            labels = torch.stack([y[i] for y, i in zip(prior_labels, picks, strict=True)])
            prior = Samples(features(drawn, grid), labels)
        batch = Samples(observed_phi[rows], observed_labels[rows])
        return log_density(particles, batch, prior, log_probabilities, lambdas)[1]

    start = torch.randn(config.particles, grid.dimension, generator=generator).to(device)
    particles = run_svgd(
        start, score, steps=config.epochs * batches, learning_rate=config.learning_rate
    )
    return HilbertPosterior(
        weights=particles.cpu().numpy(),
        center=np.asarray(center, dtype=np.float64),
        grid=grid,
        reach=reach,
    )


def _log_weights(probabilities: list[float], device: str) -> Tensor:
    """ln P(c|R) up to a constant, the largest 0.

    Only ratios matter to the mixture, and a component that is left alone after better ones could
    not be registered may have a probability that is 0 in float32.
    """
    smallest = np.finfo(np.float64).tiny
    log = np.log(np.maximum(np.asarray(probabilities, dtype=np.float64), smallest))
    return torch.from_numpy((log - log.max()).astype(np.float32)).to(device)


def _local(points: NDArray[np.floating], center: NDArray[np.floating], device: str) -> Tensor:
    local = np.asarray(points, np.float64) - np.asarray(center, np.float64)
    return torch.from_numpy(local.astype(np.float32)).to(device)


def _labels(labels: NDArray[np.bool_], device: str) -> Tensor:
    return torch.from_numpy(labels.astype(np.float32)).to(device)
