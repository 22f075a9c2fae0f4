"""What stands on the table and is background."""

from __future__ import annotations

from typing import Protocol

from tabletop.settle import Panel


class Furniture(Protocol):
    """A bin, a wall or a shelf."""

    @property
    def color(self) -> tuple[float, float, float]:
        """(3,), 0 to 1."""

    @property
    def ground(self) -> Panel:
        """What lies beneath: the table, or a floor."""

    def panels(self) -> list[Panel]:
        """Its boxes, metres, world."""
