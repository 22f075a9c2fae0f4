"""What the report of printed uncertainty says of errors that are known."""

import numpy as np
from measure_uncertainty import report

POINTS = 4000


def row(taken_for, printed, times):
    """An object whose errors are normal, `times` as large as printed; every other point is seen."""
    rng = np.random.default_rng(0)
    sigma = np.full(POINTS, printed)
    return {
        "set": "made",
        "taken_for": taken_for,
        "printed": sigma.tolist(),
        "true": np.abs(rng.normal(0, times * sigma)).tolist(),
        "seen": (np.arange(POINTS) % 2).tolist(),
    }


def cells(lines, *start):
    """The line that begins so, as its last four numbers."""
    (found,) = [line for line in lines if line.startswith(f"| {' | '.join(start)} |")]
    return [float(cell) for cell in found.strip("| ").split(" | ")[-4:]]


def test_honest_numbers_have_ratio_1_and_small_ones_more():
    lines = report([row("mug", 0.0025, 1.0), row(None, 0.005, 2.0)])
    for side in ("seen", "unseen"):
        printed, true, ratio, within = cells(lines, "made", "recognised (1)", side)
        assert (printed, true) == (2.5, 2.5) and abs(ratio - 1) < 0.05 and abs(within - 95) < 2
        printed, true, ratio, within = cells(lines, "4 to 6", "completed (1)", side)
        assert printed == 5 and abs(true - 10) < 0.3 and abs(ratio - 2) < 0.1
        assert abs(within - 68) < 3


def test_bins_that_nothing_is_in_are_left_out():
    lines = report([row("mug", 0.0025, 1.0)])
    assert [line.split(" |")[0] for line in lines if "recognised" in line] == [
        "| made",
        "| made",
        "| 2 to 3",
        "| 2 to 3",
    ]
