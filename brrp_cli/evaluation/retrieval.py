"""Figures of retrieval: is the true object found, and are the probabilities right?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brrp_cli.evaluation.bootstrap import Interval
from brrp_cli.evaluation.calibration import expected_calibration_error
from brrp_cli.evaluation.rows import Row

# Visible pixels: more than the first number, at most the second.
PIXELS = ((0, 500), (500, 2000), (2000, math.inf), (500, math.inf), (0, math.inf))
BINS = 10


@dataclass(frozen=True)
class Hits:
    """Shares of `count` objects of the prior that came first, among 3 and among 10. `above`,
    `most`: visible pixels."""

    above: float
    most: float
    count: int
    first: float
    in_3: float
    in_10: float


def hits_by_pixels(rows: Sequence[Row]) -> list[Hits]:
    """Hit rates by visible pixels, of the objects whose place is known; NaN where there is none."""
    found = []
    for above, most in PIXELS:
        ranks = np.array(
            [
                row["true_rank"]
                for row in rows
                if row.get("true_rank") is not None and above < row["visible_pixels"] <= most
            ]
        )
        shares = [float(np.mean(ranks <= k)) if len(ranks) else math.nan for k in (1, 3, 10)]
        found.append(Hits(above, most, len(ranks), *shares))
    return found


def retrieval_calibration(rows: Sequence[Row]) -> Interval:
    """Expected calibration error of P(c|R) of the most probable object, over objects inside and
    outside of the prior: is it the true one as often as its probability says?"""
    known = [row for row in rows if row.get("best_probability") is not None]
    probability = np.array([row["best_probability"] for row in known], dtype=np.float64)
    right = np.array([row["best"] == row["name"] for row in known], dtype=bool)
    error = expected_calibration_error(probability, right, BINS)
    return Interval(error, count=len(known))


def with_places(row: Row) -> Row:
    """With 0 or 1 for the true object's place, where the prior holds it, and with the probability
    that the prior does not hold it, apart for objects inside and outside."""
    rank, absent = row.get("true_rank"), row.get("not_in_prior")
    more: Row = {}
    if rank is not None:
        more |= {"true_first": rank == 1, "true_in_3": rank <= 3, "true_in_10": rank <= 10}
    if absent is not None:
        more["absent_inside" if row["in_prior"] else "absent_outside"] = absent
    return {**row, **more}
