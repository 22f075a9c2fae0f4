"""Tables of a report in Markdown."""

from __future__ import annotations

import math
from collections.abc import Sequence

from brrp_cli.evaluation.bootstrap import Interval

Column = tuple[str, str, float, int]  # heading, metric, factor, decimals


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def figure(interval: Interval, factor: float, decimals: int) -> str:
    """`0.512 [0.480, 0.544]`; a dash where there is no value."""
    if math.isnan(interval.value):
        return "–"
    value = f"{interval.value * factor:.{decimals}f}"
    if math.isnan(interval.low):
        return value
    bounds = (f"{bound * factor:.{decimals}f}" for bound in (interval.low, interval.high))
    return f"{value} [{', '.join(bounds)}]"
