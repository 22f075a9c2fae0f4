"""What stands on the table and is background."""

from __future__ import annotations

from typing import Protocol

from tabletop.settle import Panel


class Furniture(Protocol):
    """A bin or a wall."""

    @property
    def color(self) -> tuple[float, float, float]:
        """(3,), 0 to 1."""

    def panels(self) -> list[Panel]:
        """Its boxes, metres, world."""
