"""What a number of the configuration may be, where its default does not tell.

A number whose default is positive must be positive; one whose default is 0 must not be negative;
one whose default is negative may be anything. All are finite.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any

LEAST, MOST = "least", "most"


def between(default: Any, least: float, most: float) -> Any:
    """A field with that default whose values lie in [least, most]."""
    return field(default=default, metadata={LEAST: least, MOST: most})


def share(default: float) -> Any:
    """A field that is a part of something, or a probability: from 0 to 1."""
    return between(default, 0.0, 1.0)
