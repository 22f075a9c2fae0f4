"""The EM of the softmax map against slow code of its own and against numerical integration."""

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar
from scipy.special import logit, logsumexp

from brrp_cli.methods.vprism.expected_softmax import expected_softmax
from brrp_cli.methods.vprism.kernel_features import (
    BlockFeatures,
    FeatureBlock,
    KernelBasis,
    kernel_features,
)
from brrp_cli.methods.vprism.softmax_em import isotropic_prior, jaakkola_lambda, moments, update


def as_features(phi):
    """A dense matrix as one block."""
    rows, columns = np.arange(phi.shape[0]), np.arange(phi.shape[1])
    return BlockFeatures(
        n=len(phi), size=phi.shape[1], blocks=[FeatureBlock(rows, columns, phi, phi.shape[1])]
    )


def class_moments(weights):
    means, covariances = zip(
        *(moments(p, s) for p, s in zip(weights.precision, weights.shift, strict=True)),
        strict=True,
    )
    return np.array(means), np.array(covariances)


def point_bound(offset, xi, mean, variance):
    """Bouchard's and Jaakkola's bound on E[log sum_k e^z_k] of one point, written term by term."""
    total = offset
    for z, v, x in zip(mean, variance, xi, strict=True):
        curvature = (1 / (1 + np.exp(-x)) - 0.5) / (2 * x)
        second = v + (z - offset) ** 2
        total += (z - offset - x) / 2 + curvature * (second - x**2) + np.log1p(np.exp(x))
    return total


def slow_em(phi, labels, classes, variance, iterations):
    """EM with every maximisation left to a numerical optimiser; the bound after each round."""
    n, size = phi.shape
    xi, offset = np.ones((n, classes)), np.zeros(n)
    bounds = []
    for _ in range(iterations):
        means, covariances = [], []
        for k in range(classes):
            precision, shift = np.eye(size) / variance, np.zeros(size)
            for i in range(n):
                curvature = (1 / (1 + np.exp(-xi[i, k])) - 0.5) / (2 * xi[i, k])
                precision += 2 * curvature * np.outer(phi[i], phi[i])
                shift += (float(labels[i] == k) - 0.5 + 2 * offset[i] * curvature) * phi[i]
            covariances.append(np.linalg.inv(precision))
            means.append(covariances[-1] @ shift)
        likelihood = 0.0
        for i in range(n):
            z = np.array([phi[i] @ m for m in means])
            v = np.array([phi[i] @ c @ phi[i] for c in covariances])
            offset[i] = minimize_scalar(
                lambda a, z=z, v=v, x=tuple(xi[i]): point_bound(a, x, z, v),
                bracket=(-5, 5),
                tol=1e-12,
            ).x
            for k in range(classes):
                xi[i, k] = np.exp(
                    minimize(
                        lambda t, k=k, a=offset[i], z=z, v=v: point_bound(
                            a, np.exp(t), z[k : k + 1], v[k : k + 1]
                        ),
                        0.0,
                        tol=1e-14,
                    ).x[0]
                )
            likelihood += z[labels[i]] - point_bound(offset[i], xi[i], z, v)
        divergence = sum(
            0.5
            * (
                np.trace(c) / variance
                + m @ m / variance
                - size
                + size * np.log(variance)
                - np.linalg.slogdet(c)[1]
            )
            for m, c in zip(means, covariances, strict=True)
        )
        bounds.append(likelihood - divergence)
    return np.array(means), np.array(covariances), bounds


@pytest.fixture
def problem():
    rng = np.random.default_rng(3)
    phi = np.column_stack([rng.normal(size=(24, 2)), np.ones(24)])
    labels = (phi @ rng.normal(scale=2, size=(3, 4))).argmax(axis=1)
    return phi, labels, 4


def test_equals_a_slow_implementation_and_its_bound_never_falls(problem):
    phi, labels, classes = problem
    means, covariances, bounds = slow_em(phi, labels, classes, 25.0, 4)
    fitted = update(isotropic_prior(classes, 3, 25.0), as_features(phi), labels, 4)
    fast_means, fast_covariances = class_moments(fitted)
    np.testing.assert_allclose(fast_means, means, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(fast_covariances, covariances, rtol=1e-4, atol=1e-5)
    assert np.all(np.diff(bounds) > 0)


def log_evidence(counts, variance):
    """Of a softmax of two biases, by summing over a fine grid."""
    axis = np.linspace(-20, 20, 801)
    w = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    log_joint = (w * counts).sum(-1) - counts.sum() * logsumexp(w, axis=-1)
    log_joint += -0.5 * (w**2).sum(-1) / variance - np.log(2 * np.pi * variance)
    return logsumexp(log_joint) + 2 * np.log(axis[1] - axis[0])


def test_the_bound_lies_under_the_integrated_evidence():
    counts = np.array([9, 3])
    labels = np.repeat([0, 1], counts)
    *_, bounds = slow_em(np.ones((12, 1)), labels, 2, 4.0, 5)
    evidence = log_evidence(counts, 4.0)
    assert bounds[-1] < evidence


@pytest.mark.parametrize("shares", [(0.75, 0.25), (0.6, 0.3, 0.1), (0.4, 0.3, 0.2, 0.1)])
def test_biases_settle_where_the_bound_has_its_maximum(shares):
    # With much data, d bound / d z_k = 0 reads sigmoid(z_k - a) = share of class k.
    counts = np.round(np.array(shares) * 10_000).astype(int)
    labels = np.repeat(np.arange(len(shares)), counts)
    prior = isotropic_prior(len(shares), 1, 1e4)
    fitted = update(prior, as_features(np.ones((len(labels), 1))), labels, 60)
    mean, _ = class_moments(fitted)
    np.testing.assert_allclose(
        mean[1:, 0] - mean[0, 0], logit(shares[1:]) - logit(shares[0]), atol=0.01
    )


def test_without_points_the_prior_comes_back():
    prior = isotropic_prior(3, 4, 10.0)
    after = update(prior, as_features(np.empty((0, 4))), np.empty(0, dtype=int), 3)
    np.testing.assert_array_equal(after.precision, prior.precision)
    np.testing.assert_array_equal(after.shift, prior.shift)


def test_two_updates_come_close_to_one():
    rng = np.random.default_rng(5)
    points = rng.uniform(-0.1, 0.1, (3000, 3))
    labels = (np.linalg.norm(points, axis=1) < 0.06).astype(int) * (1 + (points[:, 0] > 0))
    basis = KernelBasis(rng.uniform(-0.1, 0.1, (60, 3)), 1000.0, 1e-7)
    queries = kernel_features(rng.uniform(-0.1, 0.1, (500, 3)), basis, 0.05)

    def probabilities(parts):
        weights = isotropic_prior(3, basis.size, 1e4)
        for part in parts:
            features = kernel_features(points[part], basis, 0.05)
            weights = update(weights, features, labels[part], 3)
        means, covariances = class_moments(weights)
        logits = np.stack([queries.dot(m) for m in means])
        variance = np.stack([queries.quadratic(c) for c in covariances])
        return np.stack([expected_softmax(logits, variance, k) for k in range(3)])

    everything = np.arange(3000)
    one, two = probabilities([everything]), probabilities(np.array_split(everything, 2))
    assert np.abs(one - two).mean() < 0.03
    assert (one.argmax(0) == two.argmax(0)).mean() > 0.97


def test_lambda_is_smooth_through_zero():
    assert jaakkola_lambda(np.array([0.0]))[0] == 0.125
    assert jaakkola_lambda(np.array([1e-5]))[0] == pytest.approx(0.125, rel=1e-9)
    xi = np.array([0.3, 2.0, 50.0])
    np.testing.assert_allclose(jaakkola_lambda(xi), (1 / (1 + np.exp(-xi)) - 0.5) / (2 * xi))
