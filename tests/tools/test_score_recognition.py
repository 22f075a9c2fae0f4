"""What became of an object's mask, on masks that were made to be wrong in one way."""

from __future__ import annotations

import numpy as np
import pytest
from score_recognition import cause

TRUTH = np.repeat([0, 1, 2], [100, 100, 100])


def masks(*lengths):
    """Ids 0, 1, 2, ... repeated so many times."""
    return np.repeat(np.arange(len(lengths)), lengths)


@pytest.mark.parametrize(
    ("found", "why", "shared"),
    [
        (masks(100, 100, 100), "own", []),
        (masks(100, 200), "shared", [2]),
        (masks(100, 50, 50, 100), "pieces", []),
        (masks(50, 150, 100), "table", []),
        (masks(140, 60, 100), "part", []),
        (np.where(np.arange(300) < 200, 0, 2), "missing", []),
        (masks(80, 100, 120), "rough", []),
    ],
)
def test_the_cause_is_told(found, why, shared):
    assert cause(TRUTH, found, 1) == (why, shared)
