import numpy as np
import torch

from brrp_cli.inference.svgd import median_bandwidth, run_svgd, stein_direction


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
