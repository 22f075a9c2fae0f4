"""Messages are for people: they name no error of Python and quote none of its words."""

from __future__ import annotations

import re

PYTHON = re.compile(
    r"\b[A-Z]\w*(Error|Exception)\b|NoneType|Traceback|object (is not|has no|cannot)"
    r"|indices must be|argument must be|codec|pickle|cannot reshape|string to float"
)


def assert_for_people(error: Exception) -> None:
    """Of a BrrpError that was raised over a damaged file."""
    assert not PYTHON.search(str(error)), str(error)
