"""What is taken to be so of every object that is lifted or dropped."""

from __future__ import annotations

GRAVITY = 9.81  # m / s^2
# kg / m^3 of an object's volume. A guess between an empty box (200) and a full bottle (1,000).
DENSITY = 500.0
