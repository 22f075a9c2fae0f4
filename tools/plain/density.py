"""The map's features and the log posterior over its weights (paper, sections III-A and IV-D)."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits


def hinge_points(per_axis: int, half_width: float) -> tuple[Tensor, float]:
    """(per_axis^3, 3) hinge points in a cube around the origin, and their spacing, metres; the last
    axis runs fastest."""
    axis = torch.linspace(-half_width, half_width, per_axis)
    grid = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), dim=-1)
    return grid.reshape(-1, 3), 2 * half_width / (per_axis - 1)


def dense_features(points: Tensor, hinges: Tensor, width: float, floor: float) -> Tensor:
    """(n, 1 + H): a bias and exp(-|x - h|^2 / width^2) for points (n, 3) and hinges (H, 3), 0 where
    it is under `floor`."""
    squared = (points[:, None, :] - hinges[None, :, :]).square().sum(dim=-1)
    kernel = torch.exp(-squared / width**2)
    kernel = torch.where(kernel < floor, torch.zeros_like(kernel), kernel)
    return torch.cat([torch.ones(len(points), 1, dtype=kernel.dtype), kernel], dim=1)


def mean_bce(weights: Tensor, phi: Tensor, labels: Tensor) -> Tensor:
    """Mean binary cross-entropy (P,) of particles (P, D) over samples (n, D), labels (n,)."""
    logits = weights @ phi.T
    each = binary_cross_entropy_with_logits(logits, labels.expand_as(logits), reduction="none")
    return each.mean(dim=1)


def log_posterior(
    weights: Tensor,
    observed: tuple[Tensor, Tensor],
    components: list[tuple[Tensor, Tensor]],
    probabilities: Tensor,
    lambdas: tuple[float, float, float],
) -> Tensor:
    """Unnormalised log posterior (P,) of particles (P, D).

    observed, components : features (n, D) and labels (n,), of the scene and of each registered
    object; probabilities : P(c|R) of each; lambdas : of observation, prior and norm
    """
    value = -lambdas[0] * mean_bce(weights, *observed) - lambdas[2] * weights.square().sum(dim=1)
    if components:
        terms = [
            torch.log(p) - mean_bce(weights, *samples)
            for p, samples in zip(probabilities, components, strict=True)
        ]
        value = value + lambdas[1] * torch.logsumexp(torch.stack(terms), dim=0)
    return value


def gradient(value: Tensor, of: Tensor) -> Tensor:
    """d sum(value) / d of, by autograd."""
    return torch.autograd.grad(value.sum(), of)[0]
