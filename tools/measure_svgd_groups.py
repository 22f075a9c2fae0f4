"""SVGD over two hypotheses with a posterior known in closed form: one kernel over all particles,
and one for each hypothesis.

    python tools/measure_svgd_groups.py

Bayesian linear regression: y = m_c(x) + w . phi(x) + noise, w ~ N(0, I), where m_c is the mean of
hypothesis c. Both posteriors over w are Gaussian. Each row is the mean over `--trials` problems:

    mean    RMS error of a hypothesis's mean weight, in its posterior's standard deviations
    pooled  the same, to the normalised product of both posteriors, each to the power of its share
    spread  variance of its particles over that of its posterior
    weight  of the first hypothesis's particles; its share of the posterior in brackets
    value   error of the expected value y of the mixture at new x, over the noise
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
import torch
from torch import Tensor

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.inference.infer_hypotheses import particles_of
from brrp_cli.inference.svgd import groups_of, run_svgd

NOISE = 0.5


@dataclass(frozen=True)
class TwoHypotheses:
    """Posteriors N(means[c], covariance) of two hypotheses, and their shares (2,).

    phi : (n, D); residual : (2, n), what each hypothesis leaves of y to explain
    """

    phi: Tensor
    residual: Tensor
    means: Tensor
    covariance: Tensor
    shares: Tensor

    def score(self, which: Tensor) -> Callable[[Tensor, int], Tensor]:
        """grad ln p(w | hypothesis, y) of particles (P, D) of hypotheses `which` (P,)."""
        left = self.residual[which]
        return lambda w, _step: (left - w @ self.phi.T) @ self.phi / NOISE**2 - w


def two_hypotheses(
    dimension: int, observed: int, apart: float, share: float, generator: torch.Generator
) -> TwoHypotheses:
    """A problem whose hypotheses' means of y lie `apart` from one another, RMS; `share` is the
    first one's."""
    kind = {"generator": generator, "dtype": torch.float64}
    phi = torch.randn(observed, dimension, **kind) / dimension**0.5
    truth, offset = torch.randn(dimension, **kind), torch.randn(dimension, **kind)
    y = phi @ truth + NOISE * torch.randn(observed, **kind)
    residual = torch.stack([y, y + apart * (phi @ offset)])
    precision = torch.eye(dimension, dtype=torch.float64) + phi.T @ phi / NOISE**2
    covariance = torch.linalg.inv(precision)
    means = residual @ phi @ covariance / NOISE**2
    return TwoHypotheses(
        phi, residual, means, covariance, torch.tensor([share, 1 - share], dtype=torch.float64)
    )


def errors(
    problem: TwoHypotheses,
    particles: int,
    joint: bool,
    steps: int,
    rate: float,
    generator: torch.Generator,
) -> list[float]:
    """mean, pooled, spread, weight and value as the head of this file has them."""
    placed, weights = particles_of(problem.shares.numpy(), particles)
    which, share = torch.from_numpy(placed), torch.from_numpy(weights)
    dimension = problem.means.shape[1]
    start = 0.3 * torch.randn(particles, dimension, generator=generator, dtype=torch.float64)
    found = run_svgd(
        start,
        problem.score(which),
        steps=steps,
        learning_rate=rate,
        groups=None if joint else groups_of(which),
    )
    deviation = problem.covariance.diagonal().sqrt()
    means = torch.stack([found[which == c].mean(dim=0) for c in (0, 1)])
    pool = problem.shares @ problem.means  # both covariances are equal
    spread = [
        (found[which == c].var(dim=0) / deviation**2).mean()
        for c in (0, 1)
        if (which == c).sum() > 1
    ]
    new = torch.randn(200, dimension, generator=generator, dtype=torch.float64) / dimension**0.5
    value = (share @ found - problem.shares @ problem.means) @ new.T / NOISE
    return [
        float(((means - problem.means) / deviation).square().mean().sqrt()),
        float(((means - pool) / deviation).square().mean().sqrt()),
        float(torch.stack(spread).mean()),
        float(share[which == 0].sum()),
        float(value.square().mean().sqrt()),
    ]


@click.command()
@click.option("--trials", default=5, show_default=True, type=click.IntRange(1))
@click.option("--seed", default=0, show_default=True)
@one_message()
def main(trials: int, seed: int) -> None:
    """Print the table."""
    torch.set_num_threads(1)
    click.echo(
        f"{'D':>4}{'P':>5}{'steps':>7}{'kernel':>9}"
        f"{'mean':>8}{'pooled':>8}{'spread':>8}{'weight':>15}{'value':>8}"
    )
    for dimension, particles, share, steps, rate in (
        (1, 40, 0.5, 1000, 0.02),
        (1, 40, 0.75, 1000, 0.02),
        (2, 40, 0.5, 1000, 0.02),
        (100, 8, 0.5, 40, 0.1),
        (100, 8, 0.5, 400, 0.1),
        (100, 8, 0.75, 40, 0.1),
        (100, 8, 0.75, 400, 0.1),
    ):
        for joint in (True, False):
            rows = []
            for trial in range(trials):
                generator = torch.Generator().manual_seed(seed + trial)
                problem = two_hypotheses(dimension, 3 * dimension + 10, 1.0, share, generator)
                rows.append(errors(problem, particles, joint, steps, rate, generator))
            mean, pooled, spread, weight, value = np.mean(rows, axis=0)
            click.echo(
                f"{dimension:>4}{particles:>5}{steps:>7}{'joint' if joint else 'grouped':>9}"
                f"{mean:8.3f}{pooled:8.3f}{spread:8.3f}{weight:9.3f}{f'[{share:g}]':>6}{value:8.3f}"
            )


if __name__ == "__main__":
    main()
