"""Draw a gripper's boxes and the conventions of its frame, for docs/grasping.md.

python tools/draw_gripper.py --gripper franka-hand -o docs/images/gripper_frame.png
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.grasping.gripper import Gripper
from brrp_cli.grasping.gripper_file import DEFAULT, open_gripper

X, Y, Z = "#c0392b", "#1e8449", "#2455a4"
WIDTH = 0.04  # metres, of the object that is drawn


def boxes(ax: Any, hand: Gripper, across: int) -> None:
    """The hand's three boxes, seen along y (across = 0) or along x (across = 1), millimetres."""
    from matplotlib.patches import Rectangle

    for low, high in hand.boxes(np.array([hand.opening]))[0]:
        size = (high - low) * 1000
        ax.add_patch(
            Rectangle(
                (low[across] * 1000, low[2] * 1000),
                size[across],
                size[2],
                facecolor="#d5d8dc",
                edgecolor="#2c3e50",
            )
        )


def arrow(ax: Any, end: tuple[float, float], colour: str, name: str) -> None:
    """From the frame's origin."""
    style = {"arrowstyle": "-|>", "color": colour, "lw": 2.5, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, (0, 0), arrowprops=style, zorder=5)
    ax.text(end[0] + 4, end[1] + 3, name, color=colour, weight="bold")


def measure(ax: Any, start: tuple[float, float], end: tuple[float, float], name: str) -> None:
    """A dimension's line and its name."""
    ax.annotate("", start, end, arrowprops={"arrowstyle": "<->", "color": "#555555", "lw": 1})
    middle = np.add(start, end) / 2
    upright = start[0] == end[0]
    ax.text(
        middle[0] + (3 if upright else 0),
        middle[1] + (0 if upright else 3),
        name,
        color="#555555",
        fontsize=8,
        ha="left" if upright else "center",
        va="center" if upright else "bottom",
    )


@one_message()
def main() -> None:
    """Write the picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.patches import Circle

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gripper", default=DEFAULT)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    hand = open_gripper(given.gripper)
    # Both views have one scale.
    wide = [hand.palm_width * 1000 + 75, hand.palm_depth * 1000 + 60]
    figure, (front, side) = plt.subplots(1, 2, figsize=(9, 4.6), width_ratios=wide)
    tip, palm, half = hand.tip * 1000, hand.palm_length * 1000, hand.opening * 500
    for ax, across in ((front, 0), (side, 1)):
        boxes(ax, hand, across)
        arrow(ax, (0, palm * 0.8), Z, "z approach")
        ax.plot(0, 0, "o", color="black", zorder=6)
        ax.set_aspect("equal")
        ax.invert_yaxis()
        ax.axis("off")
    front.add_patch(
        Circle((0, tip - 24), WIDTH * 500, facecolor="#f5cba7", edgecolor="#a04000", alpha=0.9)
    )
    for sign in (-1, 1):
        front.plot(sign * WIDTH * 500, tip - 24, "o", color="#a04000")
    front.text(0, tip - 24, "contacts", ha="center", va="center", fontsize=8)
    arrow(front, (palm * 0.8, 0), X, "x closing")
    arrow(side, (palm * 0.6, 0), Y, "y = z x x")
    measure(front, (-half, tip + 8), (half, tip + 8), "")
    front.text(0, tip + 18, "opening", ha="center", color="#555555", fontsize=8)
    edge = hand.palm_width * 500 + 8
    measure(front, (edge, 0), (edge, palm), "palm length")
    measure(front, (edge, palm), (edge, tip), "finger length")
    measure(side, (-hand.finger_width * 500, tip + 8), (hand.finger_width * 500, tip + 8), "")
    side.text(0, tip + 18, "finger width", ha="center", color="#555555", fontsize=8)
    front.set_title(f"{hand.name}: along y", fontsize=10)
    side.set_title("along x", fontsize=10)
    for ax, across in ((front, hand.palm_width), (side, hand.palm_depth)):
        ax.set_xlim(-across * 500 - 15, across * 500 + (60 if ax is front else 45))
        ax.set_ylim(tip + 28, -18)
    figure.savefig(given.output, dpi=110, bbox_inches="tight")


if __name__ == "__main__":
    main()
