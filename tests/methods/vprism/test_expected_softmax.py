import numpy as np
from scipy.special import softmax

from brrp_cli.methods.vprism.expected_softmax import expected_softmax


def all_classes(mean, variance):
    return np.stack([expected_softmax(mean, variance, k) for k in range(len(mean))])


def test_without_variance_it_is_the_softmax():
    mean = np.random.default_rng(0).normal(scale=4, size=(5, 50))
    np.testing.assert_allclose(all_classes(mean, np.zeros_like(mean)), softmax(mean, axis=0))


def test_two_classes_sum_to_one():
    rng = np.random.default_rng(1)
    mean, variance = rng.normal(scale=5, size=(2, 50)), rng.gamma(1, 5, size=(2, 50))
    np.testing.assert_allclose(all_classes(mean, variance).sum(axis=0), 1.0)


def test_close_to_sampled_expectations():
    rng = np.random.default_rng(2)
    mean, variance = rng.normal(scale=2, size=(3, 40)), rng.gamma(1, 1, size=(3, 40))
    draws = mean + np.sqrt(variance) * rng.normal(size=(20_000, 3, 40))
    sampled = softmax(draws, axis=1).mean(axis=0)
    assert np.abs(all_classes(mean, variance) - sampled).max() < 0.05
    assert np.abs(all_classes(mean, variance) - sampled).mean() < 0.02


def test_equal_classes_share_the_probability_whatever_the_variance():
    mean, variance = np.zeros((4, 3)), np.tile([0.0, 1.0, 1e8], (4, 1))
    np.testing.assert_allclose(all_classes(mean, variance), 0.25)


def test_extreme_logits_stay_finite():
    mean = np.array([[1e6, -1e6], [-1e6, 1e6], [0.0, 0.0]])
    probability = all_classes(mean, np.zeros_like(mean))
    np.testing.assert_array_equal(probability, [[1, 0], [0, 1], [0, 0]])
