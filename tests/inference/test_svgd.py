import numpy as np
import pytest
import torch

from brrp_cli.inference.svgd import groups_of, median_bandwidth, run_svgd, stein_direction


def gaussian_score(mean, covariance):
    precision = torch.linalg.inv(covariance)
    return lambda particles, step: -(particles - mean) @ precision


def test_recovers_a_gaussian_posterior_known_in_closed_form():
    """Bayesian linear regression: prior N(0, I), noise 0.5; the posterior is Gaussian."""
    generator = torch.Generator().manual_seed(0)
    inputs = torch.randn(12, 2, generator=generator, dtype=torch.float64)
    truth = torch.tensor([1.0, -2.0], dtype=torch.float64)
    noise = 0.5 * torch.randn(12, generator=generator, dtype=torch.float64)
    targets = inputs @ truth + noise
    precision = torch.eye(2, dtype=torch.float64) + inputs.T @ inputs / 0.25
    covariance = torch.linalg.inv(precision)
    mean = covariance @ inputs.T @ targets / 0.25

    def score(particles, step):
        residual = targets - particles @ inputs.T
        return residual @ inputs / 0.25 - particles

    start = torch.randn(100, 2, generator=generator, dtype=torch.float64)
    particles = run_svgd(start, score, steps=1500, learning_rate=0.02)
    np.testing.assert_allclose(particles.mean(dim=0), mean, atol=0.01)
    np.testing.assert_allclose(torch.cov(particles.T), covariance, atol=0.12 * covariance.max())


def test_the_steps_are_those_of_torchs_adam():
    """Of one particle, on which no other acts: Adam on its score, which falls off unevenly."""
    start = torch.tensor([[0.5, -1.0, 3.0]], dtype=torch.float64)

    def score(particles, step):
        return torch.sin(3 * particles) - (1 + step) * particles

    expected = start.clone()
    optimizer = torch.optim.Adam([expected], lr=0.1, maximize=True)
    for step in range(25):
        expected.grad = stein_direction(expected, score(expected, step))
        optimizer.step()
    found = run_svgd(start, score, steps=25, learning_rate=0.1)
    torch.testing.assert_close(found, expected, rtol=1e-12, atol=1e-12)


def test_the_direction_is_the_papers_sum_over_particles():
    particles = torch.tensor([[0.0, 0.0], [1.0, 0.5], [-0.3, 2.0]], dtype=torch.float64)
    scores = torch.tensor([[1.0, 2.0], [0.5, -1.0], [0.0, 0.3]], dtype=torch.float64)
    h = median_bandwidth(torch.cdist(particles, particles) ** 2)
    expected = torch.zeros_like(particles)
    for i in range(3):
        for j in range(3):
            source = particles[j].clone().requires_grad_()
            kernel = torch.exp(-((source - particles[i]) ** 2).sum() / h)
            (gradient,) = torch.autograd.grad(kernel, source)
            expected[i] += (kernel.detach() * scores[j] + gradient) / 3
    torch.testing.assert_close(stein_direction(particles, scores), expected)


def test_one_particle_climbs_to_the_mode():
    mean = torch.tensor([3.0, -1.0], dtype=torch.float64)
    score = gaussian_score(mean, torch.eye(2, dtype=torch.float64))
    start = torch.zeros(1, 2, dtype=torch.float64)
    found = run_svgd(start, score, steps=2000, learning_rate=0.05)
    torch.testing.assert_close(found[0], mean, rtol=0, atol=1e-3)


def test_equal_particles_stay_finite():
    particles = torch.zeros(4, 3)
    assert torch.isfinite(stein_direction(particles, torch.ones(4, 3))).all()


def test_the_start_is_not_changed():
    start = torch.ones(2, 3)
    run_svgd(start, lambda particles, step: -particles, steps=3, learning_rate=0.1)
    assert (start == 1).all()


def test_two_hypotheses_recover_their_own_posteriors_known_in_closed_form():
    """Bayesian linear regression of y = m_c + w x + noise with two means m_c, 3 : 1 likely."""
    generator = torch.Generator().manual_seed(0)
    inputs = torch.randn(12, 1, generator=generator, dtype=torch.float64)
    noise = 0.5 * torch.randn(12, generator=generator, dtype=torch.float64)
    targets = torch.stack([2 * inputs[:, 0], -inputs[:, 0]]) + noise
    which = torch.tensor([0, 1, 0, 0] * 15)
    variance = 1 / (1 + inputs.square().sum() / 0.25)
    means = variance * (targets @ inputs)[:, 0] / 0.25

    def score(particles, step):
        return (targets[which] - particles @ inputs.T) @ inputs / 0.25 - particles

    start = 0.3 * torch.randn(len(which), 1, generator=generator, dtype=torch.float64)
    particles = run_svgd(start, score, steps=800, learning_rate=0.02, groups=groups_of(which))
    found = [particles[which == group, 0] for group in (0, 1)]
    for each, mean in zip(found, means, strict=True):
        assert each.mean() == pytest.approx(float(mean), abs=0.1 * float(variance.sqrt()))
        assert each.var() == pytest.approx(float(variance), rel=0.2)
    mixture = 0.75 * means[0] + 0.25 * means[1]
    assert particles.mean() == pytest.approx(float(mixture), abs=0.1 * float(variance.sqrt()))


def test_each_group_is_svgd_by_itself():
    generator = torch.Generator().manual_seed(1)
    particles, scores = (torch.randn(9, 5, generator=generator) for _ in range(2))
    which = torch.tensor([3, 0, 3, 1, 0, 3, 0, 0, 3])
    found = stein_direction(particles, scores, groups_of(which))
    for group in (0, 3):
        rows = which == group
        expected = stein_direction(particles[rows], scores[rows])
        torch.testing.assert_close(found[rows], expected)
    torch.testing.assert_close(found[3], scores[3], rtol=0, atol=0)


def test_particles_that_are_all_alone_follow_their_scores():
    generator = torch.Generator().manual_seed(2)
    particles, scores = (torch.randn(4, 5, generator=generator) for _ in range(2))
    torch.testing.assert_close(
        stein_direction(particles, scores, groups_of(torch.arange(4))), scores
    )


def test_one_group_is_no_groups():
    assert groups_of(torch.full((8,), 5)) is None
