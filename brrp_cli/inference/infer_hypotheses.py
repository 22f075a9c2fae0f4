"""From hypotheses and observed samples to a posterior: weights that correct prior means, by SVGD.

    ln p(w | hypothesis) = - lambda_observed * mean_i BCE(y_i, m(x_i) + w . phi(x_i))
                           - lambda_norm * |w|^2

Particles are shared out among the hypotheses in proportion to their weights, so that the spread of
the particles holds what is not known of identity and pose, besides what was not seen. Each
hypothesis has a posterior of its own over w, and SVGD runs for its particles by themselves.
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
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.infer import LabelledPoints
from brrp_cli.inference.mean import MeanLattice
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.inference.svgd import groups_of, run_svgd
from brrp_cli.seeds import child_seed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """What is to be inferred.

    observed : samples near the object; mean : C prior means; which : (P,) the one of each particle;
    box : (2, 3), metres, camera frame, what was seen and the hypotheses' shapes
    """

    observed: LabelledPoints
    mean: MeanLattice
    which: NDArray[np.int64]
    box: Array


def infer_correction(
    problem: Problem, config: FittedMapConfig, *, seed: int, device: str = "cpu"
) -> HypothesisPosterior:
    """Particles over the weights. The same seed gives the same particles."""
    center = problem.box.mean(axis=0)
    grid = box_grid(problem.box - center, config)
    which = problem.which
    samples = _inside(_behind(problem.observed, config.behind), problem.box, grid.spacing)
    points = torch.from_numpy((samples.points - center).astype(np.float32)).to(device)
    phi = factors(points, grid)
    labels = torch.from_numpy(samples.labels.astype(np.float32)).to(device)
    mean = torch.from_numpy(problem.mean.logits(samples.points)[which]).to(device)
    generator = torch.Generator().manual_seed(child_seed(seed, "correction"))

    def score(weights: Tensor, step: int) -> Tensor:
        norm = -2 * config.lambda_norm * weights
        if not len(labels):
            return norm
        rows = torch.randint(len(labels), (config.batch,), generator=generator).to(device)
        return norm - config.lambda_observed * logistic_score(
            weights, phi.rows(rows), labels[rows], mean[:, rows]
        )

    start = config.start * torch.randn(len(which), grid.dimension, generator=generator)
    start[:, 0] = 0
    weights = run_svgd(
        start.to(device),
        score,
        steps=config.steps,
        learning_rate=config.learning_rate,
        groups=groups_of(torch.from_numpy(which).to(device)),
    )
    reach = float((problem.box[1] - problem.box[0]).max() / 2)
    correction = HilbertPosterior(weights.cpu().numpy(), center, grid, reach)
    return HypothesisPosterior(problem.mean, which, correction)


def share_out(weights: Array, particles: int) -> NDArray[np.int64]:
    """Hypothesis (P,) of each particle: systematic resampling, in the order of the hypotheses.

    Each of the weights (C,), sum 1, gets its share rounded up or down.
    """
    at = (np.arange(particles) + 0.5) / particles
    found = np.searchsorted(np.cumsum(weights), at)
    return np.minimum(found, len(weights) - 1).astype(np.int64)


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


def _behind(observed: LabelledPoints, distance: float) -> LabelledPoints:
    """Occupied samples moved away from the camera: a point on the surface is as much outside as
    inside, and taken for inside it would make every object thicker."""
    points = np.asarray(observed.points, dtype=np.float64).copy()
    seen = points[observed.labels]
    points[observed.labels] = seen * (1 + distance / np.linalg.norm(seen, axis=1, keepdims=True))
    return LabelledPoints(points, observed.labels)


def _inside(samples: LabelledPoints, box: Array, margin: float) -> LabelledPoints:
    """The samples that hinge points can reach."""
    points = samples.points
    kept = ((points > box[0] - margin) & (points < box[1] + margin)).all(axis=1)
    return LabelledPoints(points[kept], samples.labels[kept])
