"""Stein variational gradient descent (paper, section III-B; Liu and Wang, 2016)."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

# Adam's own (Kingma and Ba, 2015).
BETAS, EPSILON = (0.9, 0.999), 1e-8


def median_bandwidth(squared_distances: Tensor) -> Tensor:
    """h of k(x, y) = exp(-|x - y|^2 / h): median squared distance / ln(P + 1).

    squared_distances : (P, P). With it the other particles together weigh about as much as a
    particle itself. One particle has no distance, and any positive h serves.
    """
    count = squared_distances.shape[0]
    if count < 2:
        return squared_distances.new_ones(())
    rows, columns = torch.triu_indices(count, count, offset=1, device=squared_distances.device)
    median = squared_distances[rows, columns].median()
    return torch.clamp(median / math.log(count + 1), min=torch.finfo(median.dtype).tiny)


def stein_direction(particles: Tensor, scores: Tensor) -> Tensor:
    """Steepest descent of KL(q || p) in the kernel's Hilbert space (paper, equation 4).

    particles, scores : (P, D), scores = grad ln p at the particles. Returns (P, D):
    1/P sum_j k(x_j, x_i) score_j + grad_{x_j} k(x_j, x_i).
    """
    difference = particles[:, None] - particles[None, :]
    squared = difference.square().sum(dim=-1)
    bandwidth = median_bandwidth(squared)
    kernel = torch.exp(-squared / bandwidth)
    attraction = kernel @ scores
    repulsion = 2 / bandwidth * torch.einsum("ij,ijd->id", kernel, difference)
    return (attraction + repulsion) / particles.shape[0]


def run_svgd(
    particles: Tensor,
    score: Callable[[Tensor, int], Tensor],
    *,
    steps: int,
    learning_rate: float,
) -> Tensor:
    """Move particles (P, D) by Adam along the Stein direction; returns the moved ones.

    score : (particles, step) -> grad ln p (P, D); it may draw a fresh mini-batch in each step.
    """
    moving = particles.clone()
    mean, square = torch.zeros_like(moving), torch.zeros_like(moving)
    # As torch.optim.Adam does it, which imports torch's compiler for its first step: two seconds.
    for step in range(steps):
        direction = stein_direction(moving, score(moving, step))
        mean.lerp_(direction, 1 - BETAS[0])
        square.mul_(BETAS[1]).addcmul_(direction, direction, value=1 - BETAS[1])
        unbiased, spread = (1 - beta ** (step + 1) for beta in BETAS)
        size = (square.sqrt() / math.sqrt(spread)).add_(EPSILON)
        moving.addcdiv_(mean, size, value=learning_rate / unbiased)
    return moving
