import math

import pytest
import torch

from brrp_cli.inference.density import Lambdas, Samples, log_density, mean_bce

DIMENSION = 7
PARTICLES = 4
LAMBDAS = Lambdas(observed=50.0, prior=1.0, norm=1e-2)


def draw(*shape, seed=0):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def labels(*shape, seed=0):
    return (draw(*shape, seed=seed) > 0).double()


def plain_log_density(w, observed, prior, log_probabilities):
    """The equations of the module's docstring, one particle, one point at a time."""

    def bce(phi, label):
        probability = torch.sigmoid(w @ phi)
        return -torch.log(probability if label == 1 else 1 - probability)

    def mean(samples):
        return torch.stack([bce(p, y) for p, y in zip(*samples, strict=True)]).mean()

    mixture = sum(
        math.exp(log_p) * torch.exp(-mean((phi, y)))
        for log_p, phi, y in zip(log_probabilities, prior.phi, prior.labels, strict=True)
    )
    return (
        -LAMBDAS.observed * mean((observed.phi, observed.labels))
        + LAMBDAS.prior * torch.log(mixture)
        - LAMBDAS.norm * (w**2).sum()
    )


@pytest.fixture
def problem():
    observed = Samples(draw(30, DIMENSION, seed=1), labels(30, seed=2))
    prior = Samples(draw(3, 20, DIMENSION, seed=3), labels(3, 20, seed=4))
    log_probabilities = torch.tensor([0.5, 0.3, 0.2], dtype=torch.float64).log()
    return draw(PARTICLES, DIMENSION, seed=5), observed, prior, log_probabilities


def test_value_is_that_of_the_plain_equations(problem):
    weights, observed, prior, log_probabilities = problem
    value, _ = log_density(weights, observed, prior, log_probabilities, LAMBDAS)
    expected = torch.stack(
        [plain_log_density(w, observed, prior, log_probabilities) for w in weights]
    )
    torch.testing.assert_close(value, expected)


def test_score_is_the_gradient_of_the_value(problem):
    weights, observed, prior, log_probabilities = problem
    moving = weights.clone().requires_grad_()
    value, score = log_density(moving, observed, prior, log_probabilities, LAMBDAS)
    (expected,) = torch.autograd.grad(value.sum(), moving)
    torch.testing.assert_close(score, expected)


def test_without_a_prior_only_observation_and_norm_count(problem):
    weights, observed, _, _ = problem
    value, score = log_density(weights, observed, None, None, LAMBDAS)
    loss, gradient = mean_bce(weights, observed)
    torch.testing.assert_close(value, -50 * loss - 1e-2 * weights.square().sum(dim=1))
    torch.testing.assert_close(score, -50 * gradient - 2e-2 * weights)


def test_a_component_that_explains_nothing_does_not_pull(problem):
    """The mixture stands inside the log: the better component takes the responsibility."""
    weights, observed, prior, _ = problem
    sure = torch.tensor([1.0, 1e-30, 1e-30], dtype=torch.float64).log()
    _, mixed = log_density(weights, observed, prior, sure, LAMBDAS)
    alone = Samples(prior.phi[:1], prior.labels[:1])
    _, single = log_density(weights, observed, alone, sure[:1], LAMBDAS)
    torch.testing.assert_close(mixed, single)


def test_extreme_logits_stay_finite():
    weights = torch.full((1, 1), 1e4)
    samples = Samples(torch.tensor([[1.0], [-1.0]]), torch.tensor([0.0, 1.0]))
    loss, gradient = mean_bce(weights, samples)
    assert loss.item() == 1e4
    assert torch.isfinite(gradient).all()
