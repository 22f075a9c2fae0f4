"""Bayesian multi-class logistic regression by variational EM.

The softmax has no conjugate prior. Bouchard ("Efficient bounds for the softmax function", 2007)
bounds its normaliser by a product of sigmoids, and Jaakkola's quadratic bounds each sigmoid:

    log sum_k e^{z_k} <= a + sum_k [ (z_k - a - xi_k) / 2 + lambda(xi_k) ((z_k - a)^2 - xi_k^2)
                                     + log(1 + e^{xi_k}) ],   lambda(xi) = tanh(xi / 2) / (4 xi)

for every a and xi_k. With z_k = w_k . phi(x) and Gaussian w_k this gives a Gaussian for each
class, and EM tightens the bound (V-PRISM, Wright et al. 2024, section on the softmax map). Each
step below maximises the bound over what it sets, so the bound never falls.

The bound is loose and its maximum overconfident: with a bias alone and class shares p_k it settles
at z_k = a + log(p_k / (1 - p_k)), so that two classes of 3 : 1 come out as 9 : 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.methods.vprism.kernel_features import BlockFeatures

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ClassWeights:
    """A Gaussian for the weights of each class, in information form.

    precision : (K, F, F), inverse covariance; shift : (K, F), precision times mean
    """

    precision: Floats
    shift: Floats


def isotropic_prior(classes: int, features: int, variance: float) -> ClassWeights:
    """N(0, variance I) for every class."""
    precision = np.zeros((classes, features, features))
    precision[:, np.arange(features), np.arange(features)] = 1.0 / variance
    return ClassWeights(precision, np.zeros((classes, features)))


def moments(precision: Floats, shift: Floats) -> tuple[Floats, Floats]:
    """Mean (F,) and covariance (F, F) of one class from its information form."""
    from scipy.linalg import cholesky
    from scipy.linalg.lapack import dpotri

    factor = cholesky(precision, lower=True, check_finite=False)
    lower = np.tril(dpotri(factor, lower=1, overwrite_c=1)[0])
    covariance = lower + np.tril(lower, -1).T
    return covariance @ shift, covariance


def jaakkola_lambda(xi: Floats) -> Floats:
    """tanh(xi / 2) / (4 xi); 1/8 at xi = 0."""
    small = np.abs(xi) < 1e-6
    safe = np.where(small, 1.0, xi)
    return np.where(small, 0.125, np.tanh(safe / 2) / (4 * safe))


def update(
    prior: ClassWeights, features: BlockFeatures, labels: NDArray[np.integer], iterations: int
) -> ClassWeights:
    """Posterior after the labelled points, by `iterations` rounds of EM.

    features : Phi of n points; labels : (n,) class of each, 0 to K - 1. What comes back can be
    the prior of a further update with further points.
    """
    classes = len(prior.shift)
    targets = (labels == np.arange(classes)[:, None]) - 0.5
    xi = np.ones((classes, features.n))
    offset = np.zeros(features.n)
    precision, shift = np.empty_like(prior.precision), np.empty_like(prior.shift)
    logit, second = np.empty_like(xi), np.empty_like(xi)
    for iteration in range(iterations):
        curvature = jaakkola_lambda(xi)
        last = iteration == iterations - 1
        for k in range(classes):
            if k == 0 or iteration > 0:  # at first all classes have the same curvature
                gram = features.gram(2 * curvature[k])
            np.add(prior.precision[k], gram, out=precision[k])
            shift[k] = prior.shift[k] + features.transpose_dot(
                targets[k] + 2 * offset * curvature[k]
            )
            if not last:
                mean, covariance = moments(precision[k], shift[k])
                logit[k] = features.dot(mean)
                second[k] = features.quadratic(covariance)
        if not last:
            offset = _best_offset(curvature, logit)
            xi = np.sqrt(second + (logit - offset) ** 2)
    return ClassWeights(precision, shift)


def _best_offset(curvature: Floats, logit: Floats) -> Floats:
    """Bouchard's a, (n,), where the bound is tightest given xi and the expected logits (K, n)."""
    classes = len(logit)
    return ((classes / 2 - 1) / 2 + (curvature * logit).sum(axis=0)) / curvature.sum(axis=0)
