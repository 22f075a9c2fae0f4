"""A map of space into classes: Gaussian weights for each class over kernel features."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.methods.vprism.kernel_features import KernelBasis, kernel_features
from brrp_cli.methods.vprism.softmax_em import isotropic_prior, moments, update

Floats = NDArray[np.float64]

# Sides of the cubes that points are grouped by, metres, chosen for speed alone: samples are sparse
# and many classes share their features, queries are often dense grids.
_FIT_CELL = 0.1
_QUERY_CELL = 0.05
_QUERY_POINTS = 65_536


@dataclass(frozen=True)
class SoftmaxMap:
    """Weights of class k are N(mean[k], covariance[k]), classes independent.

    mean : (K, F); covariance : (K, F, F); F = basis.size
    """

    basis: KernelBasis
    mean: Floats
    covariance: Floats

    def logits(self, points: NDArray[np.floating], classes: list[int]) -> tuple[Floats, Floats]:
        """Mean and variance, (len(classes), n) each, of w_k . phi(x) at points (n, 3), metres.

        A point's result does not depend on the points that it is asked with.
        """
        mean = np.empty((len(classes), len(points)))
        variance = np.empty_like(mean)
        for start in range(0, len(points), _QUERY_POINTS):
            part = slice(start, start + _QUERY_POINTS)
            chunk = np.asarray(points[part], dtype=np.float64)
            features = kernel_features(chunk, self.basis, _QUERY_CELL)
            for row, k in enumerate(classes):
                mean[row, part] = features.dot(self.mean[k])
                variance[row, part] = features.quadratic(self.covariance[k])
        return mean, variance


def fit_softmax_map(
    samples: NDArray[np.floating],
    labels: NDArray[np.integer],
    classes: int,
    basis: KernelBasis,
    *,
    prior_variance: float,
    iterations: int,
    max_points: int,
    rng: np.random.Generator,
) -> SoftmaxMap:
    """Map learnt from samples (S, 3), metres, with labels (S,), 0 to classes - 1.

    More than `max_points` samples are shuffled and split into equal parts, each of which updates
    what the parts before it left.
    """
    weights = isotropic_prior(classes, basis.size, prior_variance)
    order = rng.permutation(len(samples))
    for part in np.array_split(order, max(1, -(-len(samples) // max_points))):
        features = kernel_features(samples[part].astype(np.float64), basis, _FIT_CELL)
        weights = update(weights, features, labels[part], iterations)
    mean, covariance = np.empty_like(weights.shift), np.empty_like(weights.precision)
    for k in range(classes):
        mean[k], covariance[k] = moments(weights.precision[k], weights.shift[k])
    return SoftmaxMap(basis, mean, covariance)
