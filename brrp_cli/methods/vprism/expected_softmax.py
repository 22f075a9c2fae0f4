"""Expected softmax of independent Gaussian logits, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def expected_softmax(mean: Floats, variance: Floats, chosen: int) -> Floats:
    """Probability (n,) of class `chosen` under logits N(mean, variance), both (K, n).

    Softmax is written through pairs, 1 / (2 - K + sum_{j != k} 1 / sigmoid(z_k - z_j)), and each
    pair's expectation through MacKay's approximation s_j = sigmoid(m / sqrt(1 + pi v / 8)), with m
    and v the mean and variance of z_k - z_j (V-PRISM, Wright et al. 2024; Daunizeau 2017). Since
    1 / sigmoid(t) = 1 + e^{-t}, the whole is 1 / (1 + sum_j e^{-t_j}), which never divides by 0.
    The probabilities of all classes sum to 1 only approximately, exactly for two classes.
    """
    from scipy.special import expit, logsumexp

    others = np.delete(np.arange(len(mean)), chosen)
    gap = mean[others] - mean[chosen]
    spread = np.sqrt(1 + np.pi * (variance[others] + variance[chosen]) / 8)
    return np.asarray(expit(-logsumexp(gap / spread, axis=0)), dtype=np.float64)
