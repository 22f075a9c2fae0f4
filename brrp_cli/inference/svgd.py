"""Stein variational gradient descent (paper, section III-B; Liu and Wang, 2016)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

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


@dataclass(frozen=True)
class Groups:
    """Particles (P,) in groups, each with a target density of its own.

    strangers : (P, P) bool, which two are of different groups; sizes : (P, 1), particles in the
    group of each
    pairs : (G, m) of each group, places in a flattened (P, P) of its pairs, filled up with pairs of
    strangers; medians : (G, 1), which of the sorted pairs is the median; groups : (P,), of each
    """

    strangers: Tensor
    sizes: Tensor
    pairs: Tensor
    medians: Tensor
    groups: Tensor

    def bandwidths(self, squared_distances: Tensor) -> Tensor:
        """(P, 1): `median_bandwidth` of each particle's group.

        squared_distances : (P, P), infinite between strangers.
        """
        pairs = squared_distances.flatten()[self.pairs].sort(dim=1).values
        median = pairs.gather(1, self.medians)[self.groups]
        tiny = torch.finfo(median.dtype).tiny
        bandwidths = torch.clamp(median / torch.log1p(self.sizes), min=tiny)
        return torch.where(self.sizes < 2, 1.0, bandwidths)


def groups_of(which: Tensor) -> Groups | None:
    """Groups from the label (P,) of each particle's; None if all have the same."""
    labels, groups = which.unique(return_inverse=True)
    if len(labels) < 2:
        return None
    count = len(which)
    strangers = groups[:, None] != groups[None, :]
    rows, columns = torch.triu_indices(count, count, offset=1, device=which.device)
    inside = [(groups[rows] == g) & (groups[columns] == g) for g in range(len(labels))]
    places = [(rows * count + columns)[each] for each in inside]
    stranger = strangers.flatten().nonzero()[0]
    most = max(1, *(len(each) for each in places))
    pairs = torch.stack([torch.cat([each, stranger.expand(most - len(each))]) for each in places])
    medians = [[max(len(each) - 1, 0) // 2] for each in places]
    return Groups(
        strangers,
        groups.bincount()[groups][:, None],
        pairs,
        torch.tensor(medians, device=which.device),
        groups,
    )


def stein_direction(particles: Tensor, scores: Tensor, groups: Groups | None = None) -> Tensor:
    """Steepest descent of KL(q || p) in the kernel's Hilbert space (paper, equation 4).

    particles, scores : (P, D), scores = grad ln p at the particles. Returns (P, D):
    1/P sum_j k(x_j, x_i) score_j + grad_{x_j} k(x_j, x_i).

    groups : None if all particles have the same target p. Otherwise each group is SVGD by itself,
    with its own bandwidth, and a group of one particle follows its score. (A kernel across groups
    moves particles of all groups by one velocity field, whatever their targets: from a common start
    they all approach the normalised product of the targets, each to the power of its share.)
    """
    difference = particles[:, None] - particles[None, :]
    squared = difference.square().sum(dim=-1)
    sizes: int | Tensor = particles.shape[0]
    if groups is None:
        bandwidth = median_bandwidth(squared)
    else:
        squared = squared.masked_fill(groups.strangers, math.inf)
        bandwidth, sizes = groups.bandwidths(squared), groups.sizes
    kernel = torch.exp(-squared / bandwidth)
    attraction = kernel @ scores
    repulsion = 2 / bandwidth * torch.einsum("ij,ijd->id", kernel, difference)
    return (attraction + repulsion) / sizes


def run_svgd(
    particles: Tensor,
    score: Callable[[Tensor, int], Tensor],
    *,
    steps: int,
    learning_rate: float,
    groups: Groups | None = None,
) -> Tensor:
    """Move particles (P, D) by Adam along the Stein direction; returns the moved ones.

    score : (particles, step) -> grad ln p (P, D); it may draw a fresh mini-batch in each step.
    groups : as in `stein_direction`.
    """
    moving = particles.clone()
    mean, square = torch.zeros_like(moving), torch.zeros_like(moving)
    # As torch.optim.Adam does it, which imports torch's compiler for its first step: two seconds.
    for step in range(steps):
        direction = stein_direction(moving, score(moving, step), groups)
        mean.lerp_(direction, 1 - BETAS[0])
        square.mul_(BETAS[1]).addcmul_(direction, direction, value=1 - BETAS[1])
        unbiased, spread = (1 - beta ** (step + 1) for beta in BETAS)
        size = (square.sqrt() / math.sqrt(spread)).add_(EPSILON)
        moving.addcdiv_(mean, size, value=learning_rate / unbiased)
    return moving
