"""From hypotheses and observed samples to a posterior: weights that correct prior means, by SVGD.

    ln p(w | hypothesis) = - lambda_observed * mean_i BCE(y_i, m(x_i) + w . phi(x_i))
                           - lambda_norm * |w|^2

y_i is the probability that x_i is occupied, given what the sensor measured and how far it errs: a
sample within the sensor's noise of the surface says little. Each hypothesis has the weight that
verification gave it, whatever number of particles describes it, and a posterior of its own over w:
SVGD runs for its particles by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from brrp_cli.config import FittedMapConfig
from brrp_cli.inference.density import logistic_score
from brrp_cli.inference.hinge import HingeGrid, factors
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior, MeanFunction
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.inference.svgd import groups_of, run_svgd
from brrp_cli.observation.soft_samples import SoftSamples
from brrp_cli.seeds import child_seed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """What is to be inferred.

    observed : samples near the object; means : of C hypotheses; weights : (C,), sum 1, of the
    hypotheses; stiffness : (C,) factors of lambda_norm; noise : metres, a placed shape whose
    surface lies so near to a measured point explains it; box : (2, 3), metres, camera frame, what
    was seen and the hypotheses' shapes; common : metres, what all of the depth is off alike
    """

    observed: SoftSamples
    means: tuple[MeanFunction, ...]
    weights: Array
    stiffness: Array
    noise: float
    box: Array
    common: float = 0.0


def infer_correction(
    problem: Problem, config: FittedMapConfig, *, seed: int, device: str = "cpu"
) -> HypothesisPosterior:
    """Particles over the weights. The same seed gives the same particles."""
    center = problem.box.mean(axis=0)
    grid = box_grid(problem.box - center, config)
    which, shares = particles_of(problem.weights, config.particles)
    samples = _inside(problem.observed, problem.box, grid.spacing)
    points = torch.from_numpy((samples.points - center).astype(np.float32)).to(device)
    phi = factors(points, grid)
    targets = torch.from_numpy(samples.targets.astype(np.float32)).to(device)
    logits = [mean.logits(samples.points) for mean in problem.means]
    counted = [
        _counted(mean, m, samples, problem.noise, config.contradiction)
        for mean, m in zip(problem.means, logits, strict=True)
    ]
    mean = torch.from_numpy(np.stack(logits)[which]).to(device)
    counts = torch.from_numpy(np.stack(counted)[which]).to(device)
    stiffness = torch.from_numpy(problem.stiffness[which].astype(np.float32)).to(device)[:, None]
    generator = torch.Generator().manual_seed(child_seed(seed, "correction"))

    def score(weights: Tensor, step: int) -> Tensor:
        norm = -2 * config.lambda_norm * stiffness * weights
        if not len(targets):
            return norm
        rows = torch.randint(len(targets), (config.batch,), generator=generator).to(device)
        return norm - config.lambda_observed * logistic_score(
            weights,
            phi.rows(rows),
            targets.index_select(0, rows),
            mean.index_select(1, rows),
            counts.index_select(1, rows),
        )

    start = config.start * torch.randn(len(which), grid.dimension, generator=generator)
    start[:, 0] = 0
    start = start.to(device) / stiffness.sqrt()
    weights = run_svgd(
        start,
        score,
        steps=config.steps,
        learning_rate=config.learning_rate,
        groups=groups_of(torch.from_numpy(which).to(device)),
    )
    reach = float((problem.box[1] - problem.box[0]).max() / 2)
    correction = HilbertPosterior(weights.cpu().numpy(), center, grid, reach)
    return HypothesisPosterior(
        problem.means, which, shares, correction, problem.box, problem.common, config.spread
    )


def _counted(
    mean: MeanFunction,
    logits: NDArray[np.float32],
    samples: SoftSamples,
    noise: float,
    contradiction: float,
) -> NDArray[np.float32]:
    """How much each sample (n,) counts for a hypothesis with `logits` (n,) there: 1, as a rule.

    For a placed shape, 0 for those of the seen surface that it explains to within the noise: the
    placement has been fitted to them, and behind a thin wall they would be taken for its inside.
    And `contradiction` for what lies further inside of it than that, and was seen there or seen to
    be free. Not for what was seen outside of it: masks reach beyond objects more often than objects
    beyond their shapes. Nor for kin, which are off by more than the noise in any case.
    """
    counted = np.ones(len(samples.points), np.float32)
    if isinstance(mean, PlacedShape):
        measured = np.isfinite(samples.measured[:, 0])
        seen, free = np.flatnonzero(measured), np.flatnonzero(~measured & (logits > 0))
        distance = mean.signed_distance(samples.measured[seen], noise)
        if mean.kin:
            contradiction = 1.0
        counted[seen] = np.where(distance < -noise, contradiction, distance > noise)
        deep = mean.signed_distance(samples.points[free], noise) < -noise
        counted[free[deep]] = contradiction
    return counted


def particles_of(weights: Array, particles: int) -> tuple[NDArray[np.int64], Array]:
    """Hypothesis (P,) and share (P,) of each particle, for weights (C,), sum 1, none of them 0.

    Every hypothesis has one particle at least, so that P is C where there are more hypotheses than
    `particles`; the others go one by one to the hypothesis whose particles weigh most. A particle
    weighs what its hypothesis does, divided by the number of its particles.
    """
    counts = np.ones(len(weights), dtype=np.int64)
    for _ in range(particles - len(weights)):
        counts[np.argmax(weights / counts)] += 1
    which = np.repeat(np.arange(len(weights)), counts)
    return which, (weights / counts)[which]


def box_grid(box: Array, config: FittedMapConfig) -> HingeGrid:
    """About `config.hinges` hinge points, evenly over a box (2, 3) and beyond it to the next."""
    low, high = box
    spacing = float((np.prod(high - low) / config.hinges) ** (1 / 3))
    spacing = max(spacing, config.least_spacing)
    counts = np.ceil((high - low) / spacing - 1e-9).astype(np.int64) + 1
    lower = (low + high) / 2 - (counts - 1) * spacing / 2
    x, y, z = (float(v) for v in lower)
    nx, ny, nz = (int(n) for n in counts)
    return HingeGrid((x, y, z), (nx, ny, nz), spacing, config.feature_floor)


def _inside(samples: SoftSamples, box: Array, margin: float) -> SoftSamples:
    """The samples that hinge points can reach."""
    points = samples.points
    kept = ((points > box[0] - margin) & (points < box[1] + margin)).all(axis=1)
    return SoftSamples(points[kept], samples.targets[kept], samples.measured[kept])
