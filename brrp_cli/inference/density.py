"""The log posterior over Hilbert-map weights and its gradient (paper, section IV-D).

    ln p(w) = - lambda_observed * mean_i BCE(y_i, w . phi(x_i))
              + lambda_prior * ln sum_c P(c|R) exp(-mean_q BCE(y_cq, w . phi(x_cq)))
              - lambda_norm * |w|^2

BCE is a loss, so the density falls with it; the mixture over retrieved objects stands inside one
log for each seen object. Both differ from the paper's printed equations, which have the signs and
the order the other way round.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import pad, softplus

from brrp_cli.inference.hinge import Factors


@dataclass(frozen=True)
class Samples:
    """Labelled points as features: phi (..., n, D) and labels (..., n), 1 = occupied."""

    phi: Tensor
    labels: Tensor


@dataclass(frozen=True)
class Lambdas:
    """Weights of the three terms."""

    observed: float
    prior: float
    norm: float


def mean_bce(weights: Tensor, samples: Samples) -> tuple[Tensor, Tensor]:
    """Mean binary cross-entropy and its gradient (paper, equation 1).

    weights : (P, D). Samples (n, D) give ((P,), (P, D)); samples of C components (C, n, D) give
    ((C, P), (C, P, D)).
    """
    logits = weights @ samples.phi.mT
    labels = samples.labels[..., None, :]
    loss = (softplus(logits) - labels * logits).mean(dim=-1)
    residual = (torch.sigmoid(logits) - labels) / logits.shape[-1]
    return loss, residual @ samples.phi


def logistic_score(
    weights: Tensor, phi: Factors, labels: Tensor, mean: Tensor, counted: Tensor
) -> Tensor:
    """Gradient (P, D) of the mean binary cross-entropy of logits mean + w . phi, without a bias.

    weights : (P, D), the first of each, the bias, not used; phi : of n points; labels : (n,);
    mean : (P, n), a logit of each particle's own; counted : (P, n), how much each point
    counts for a particle. The first column of the gradient is 0.
    """
    logits = mean + phi.dot(weights[:, 1:])
    residual = counted * (torch.sigmoid(logits) - labels) / logits.shape[-1]
    gradient = phi.transpose_dot(residual)
    return pad(gradient, (1, 0))


def log_density(
    weights: Tensor,
    observed: Samples,
    prior: Samples | None,
    log_probabilities: Tensor | None,
    lambdas: Lambdas,
) -> tuple[Tensor, Tensor]:
    """Unnormalised log posterior (P,) and its gradient, the score (P, D), of particles (P, D).

    prior : samples of C registered objects, (C, Q, D), or None when nothing could be registered;
    log_probabilities : (C,), ln P(c|R).
    """
    loss, gradient = mean_bce(weights, observed)
    value = -lambdas.observed * loss - lambdas.norm * weights.square().sum(dim=-1)
    score = -lambdas.observed * gradient - 2 * lambdas.norm * weights
    if prior is not None and log_probabilities is not None:
        loss, gradient = mean_bce(weights, prior)
        component = log_probabilities[:, None] - loss
        value = value + lambdas.prior * torch.logsumexp(component, dim=0)
        responsibility = torch.softmax(component, dim=0)
        score = score - lambdas.prior * torch.einsum("cp,cpd->pd", responsibility, gradient)
    return value, score
