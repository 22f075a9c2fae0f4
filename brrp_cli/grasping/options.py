"""What a user decides about grasps, where nothing is said."""

from __future__ import annotations

ALL, TOP_DOWN, CONE = "all", "top-down", "cone"
APPROACHES = (ALL, TOP_DOWN, CONE)
PER_OBJECT = 20
MIN_SCORE = 0.3
