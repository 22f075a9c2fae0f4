"""For what the posterior takes an object of the scene: the true one, a stranger, at which size."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.evaluation.pose_error import RIGHT
from brrp_cli.reconstruction import ObjectReconstruction, Retrieved

Row = dict[str, Any]

RECOGNITION = ("recognised", "taken_for", "weight_true", "weight_best", "size_factor")
# Shares and means over objects that each of them asks for.
RECOGNITION_FIGURES = (
    "recognised_clear",
    "weight_true_clear",
    "other_size",
    "placement_recognised",
    "pose_recognised",
    "pose_right",
    "pose_told",
    "stranger_taken",
)
CLEAR_PIXELS = 1000  # visible; fewer may be too few to tell
OTHER_SIZE = 0.02  # share of its true size by which a placed model is off at another size
TAKEN = 0.5  # weight at which a stranger is taken for a stored object


def recognition(
    item: ObjectReconstruction, true_name: str, in_prior: bool, true_half_extent: float
) -> Row:
    """`RECOGNITION` of one object; empty where the method weighs no hypotheses.

    true_half_extent : half the longest side of the true mesh's box along its own axes, metres

    taken_for : the stored object with most weight, weight_best : that weight; both None where none
    has any. recognised : whether more weight is on the true object than on any other and than on
    that it is none of them; weight_true : on it; size_factor : its placed size over its true size.
    The last three are None for an object that the prior does not hold.
    """
    weighed = [(each.weight, each) for each in item.retrieved if each.weight is not None]
    if not weighed:
        return {}
    weight, best = max(weighed, key=lambda pair: pair[0])
    found: Row = {
        "taken_for": best.name if weight > 0 else None,
        "weight_best": weight,
    }
    if not in_prior:
        return found
    recognised = best.name == true_name and weight > (item.unknown_weight or 0.0)
    mine = next((each for _, each in weighed if each.name == true_name), None)
    return found | {
        "recognised": recognised,
        "weight_true": 0.0 if mine is None else mine.weight,
        "size_factor": _placed_half_extent(best) / true_half_extent if recognised else None,
    }


def with_recognition(row: Row) -> Row:
    """With `RECOGNITION_FIGURES`, each where it has a meaning: of objects of the prior with at
    least 1,000 visible pixels, whether they are recognised and the weight of the true object; of
    recognised ones, whether they are placed at another size, the distance of the placed model to
    the true surface, that of its points from where they truly are, whether that is less than a
    tenth of its diameter, and whether it is for any of the poses that are alike; of others, whether
    more than half of the weight is on one stored object."""
    more: Row = {}
    recognised = row.get("recognised")
    if recognised is not None and row["visible_pixels"] >= CLEAR_PIXELS:
        more |= {"recognised_clear": recognised, "weight_true_clear": row["weight_true"]}
    if recognised:
        # Not at its own size where it has none, too.
        own = row["size_factor"] is not None and abs(row["size_factor"] - 1) <= OTHER_SIZE
        more |= {"other_size": not own, "placement_recognised": row.get("placement_error")}
        more |= _pose_figures(row)
    if recognised is None and row.get("weight_best") is not None:
        more["stranger_taken"] = row["weight_best"] > TAKEN
    return {**row, **{name: value for name, value in more.items() if value is not None}}


def _pose_figures(row: Row) -> Row:
    error = row.get("pose_error")
    if error is None:
        return {}
    near = RIGHT * row["diameter"]
    told = row["least_pose_error"] < near
    return {"pose_recognised": error, "pose_right": error < near, "pose_told": told}


def _placed_half_extent(placed: Retrieved) -> float:
    """Half the longest side of a placed model's box along its own axes, metres: coordinates of
    stored objects are normalised by it. NaN where it is not placed."""
    if placed.T_cam_object is None:
        return float("nan")
    return float(np.cbrt(np.linalg.det(placed.T_cam_object[:3, :3])))


def half_extent(vertices: NDArray[np.floating], T_world_object: NDArray[np.floating]) -> float:
    """Half the longest side, metres, of the box around `vertices` (n, 3), world metres, along the
    object's axes."""
    axes = T_world_object[:3, :3] / np.cbrt(np.linalg.det(T_world_object[:3, :3]))
    return float(np.ptp(vertices @ axes, axis=0).max() / 2)
