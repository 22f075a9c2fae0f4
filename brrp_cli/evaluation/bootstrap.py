"""Means and medians with bootstrap intervals over scenes.

Objects of one scene share its clutter, its view and its camera, so that they are no independent
draws: whole scenes are drawn again, with all of their objects (cluster bootstrap).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

ROUNDS = 4000
COVERAGE = 0.95

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Interval:
    """A figure with its 95 % interval; `count`: objects that it rests on. NaN: none."""

    value: float
    low: float = math.nan
    high: float = math.nan
    count: int = 0


def cluster_bootstrap(
    sums: Floats, statistic: Callable[[Floats], Floats], rng: np.random.Generator
) -> tuple[float, float, float]:
    """Value and interval of a statistic of sums over clusters.

    sums : (c, d), what each of c clusters adds; statistic : from totals (r, d) to values (r,).
    With one cluster there is nothing to draw from: the interval is NaN.
    """
    value = float(statistic(sums.sum(axis=0, keepdims=True))[0])
    clusters = len(sums)
    if clusters < 2:
        return value, math.nan, math.nan
    draws = rng.multinomial(clusters, np.full(clusters, 1 / clusters), size=ROUNDS)
    values = statistic(draws @ sums)
    tail = (1 - COVERAGE) / 2 * 100
    # A draw may hold only scenes without a value.
    low, high = np.nanpercentile(values, [tail, 100 - tail])
    return value, float(low), float(high)


def mean_interval(
    values: Sequence[float], clusters: Sequence[str], rng: np.random.Generator
) -> Interval:
    """Mean of the values that are there (not NaN) over objects, drawn by cluster (scene)."""
    array = np.asarray(values, dtype=np.float64)
    there = ~np.isnan(array)
    if not there.any():
        return Interval(math.nan)
    _, which = np.unique(np.asarray(clusters)[there], return_inverse=True)
    count = np.bincount(which)
    total = np.bincount(which, weights=array[there])
    value, low, high = cluster_bootstrap(np.column_stack([total, count]), _ratio, rng)
    return Interval(value, low, high, int(there.sum()))


def median_interval(
    values: Sequence[float], clusters: Sequence[str], rng: np.random.Generator
) -> Interval:
    """Median of the values that are there (not NaN) over objects, drawn by cluster (scene)."""
    array = np.asarray(values, dtype=np.float64)
    there = ~np.isnan(array)
    if not there.any():
        return Interval(math.nan)
    array = array[there]
    names, which = np.unique(np.asarray(clusters)[there], return_inverse=True)
    # Of each cluster: how many objects it adds at each place of the sorted values.
    order = np.argsort(array)
    ordered, adds = array[order], np.zeros((len(names), len(array)))
    adds[which[order], np.arange(len(array))] = 1
    value, low, high = cluster_bootstrap(adds, partial(_median, ordered), rng)
    return Interval(value, low, high, len(array))


def _median(ordered: Floats, counts: Floats) -> Floats:
    """Medians (r,) of ascending values (n,) that count `counts` (r, n) times each."""
    below = counts.cumsum(axis=1)
    total = below[:, -1]
    lower = (below < ((total + 1) // 2)[:, None]).sum(axis=1)
    upper = (below < (total // 2 + 1)[:, None]).sum(axis=1)
    return np.asarray((ordered[lower] + ordered[upper]) / 2)


def calibration_interval(
    diagrams: Sequence[Floats], clusters: Sequence[str], rng: np.random.Generator
) -> Interval:
    """Expected calibration error of a set from its objects' reliability sums.

    diagrams : (3, b) of each object: points, sum of probabilities, occupied points in each bin.
    """
    if not diagrams:
        return Interval(math.nan)
    names, which = np.unique(np.asarray(clusters), return_inverse=True)
    sums = np.zeros((len(names), np.asarray(diagrams[0]).size))
    np.add.at(sums, which, np.stack([np.ravel(d) for d in diagrams]))
    value, low, high = cluster_bootstrap(sums, calibration_error, rng)
    return Interval(value, low, high, len(diagrams))


def calibration_error(sums: Floats) -> Floats:
    """sum_b |occupied_b - probability_b| / points, for sums (r, 3 b) of bins: (r,)."""
    count, probability, occupied = np.split(sums, 3, axis=1)
    return np.asarray(np.abs(occupied - probability).sum(axis=1) / count.sum(axis=1))


def _ratio(totals: Floats) -> Floats:
    with np.errstate(invalid="ignore"):
        return np.asarray(totals[:, 0] / totals[:, 1])
