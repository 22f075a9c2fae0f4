"""Stein variational gradient descent over mini-batches (paper, sections III-B and IV-D)."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from brrp_cli.config import InferenceConfig
from plain.density import dense_features, gradient, hinge_points, log_posterior

Labelled = tuple[NDArray[np.floating], NDArray[np.bool_]]


def stein_direction(particles: Tensor, scores: Tensor) -> Tensor:
    """Equation 4 for particles (P, D) and scores (P, D), the kernel's gradient by autograd."""
    moving = particles.detach().requires_grad_(True)
    with torch.no_grad():
        apart = torch.pdist(particles).square()
        bandwidth = apart.median() / math.log(len(particles) + 1)
    squared = (moving[:, None] - particles.detach()[None, :]).square().sum(dim=-1)
    kernel = torch.exp(-squared / bandwidth)
    # d k(x_j, x_i) / d x_j, summed over j, is minus that by x_i: the kernel is symmetric.
    repulsion = -gradient(kernel, moving)
    return (kernel.detach() @ scores + repulsion) / len(particles)


def infer(
    observed: Labelled,
    components: list[Labelled],
    probabilities: list[float],
    center: NDArray[np.floating],
    config: InferenceConfig,
    seed: int,
) -> Tensor:
    """Particles (P, H + 1) for samples (points (n, 3), labels (n,)), metres, camera frame."""
    generator = torch.Generator().manual_seed(seed)
    hinges, width = hinge_points(config.hinges_per_axis, config.hinge_half_width)
    shares = torch.tensor(probabilities, dtype=torch.float32).clamp_min(1e-30)
    lambdas = (config.lambda_observed, config.lambda_prior, config.lambda_norm)

    def batch(samples: Labelled, rows: Tensor) -> tuple[Tensor, Tensor]:
        points = torch.from_numpy((samples[0][rows] - center).astype(np.float32))
        labels = torch.from_numpy(samples[1][rows].astype(np.float32))
        return dense_features(points, hinges, width, config.feature_floor), labels

    count = len(observed[0])
    particles = torch.randn(config.particles, len(hinges) + 1, generator=generator)
    optimizer = torch.optim.Adam([particles], lr=config.learning_rate, maximize=True)
    for _ in range(config.epochs):
        order = torch.randperm(count, generator=generator)
        for rows in order.split(config.observed_batch):
            drawn = [
                batch(c, torch.randint(len(c[0]), (config.prior_batch,), generator=generator))
                for c in components
            ]
            moving = particles.detach().requires_grad_(True)
            value = log_posterior(moving, batch(observed, rows), drawn, shares, lambdas)
            particles.grad = stein_direction(particles, gradient(value, moving))
            optimizer.step()
    return particles
