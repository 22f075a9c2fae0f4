"""For what the posterior takes an object of the scene: the true one, a stranger, at which size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.reconstruction import ObjectReconstruction, Retrieved

RECOGNITION = ("recognised", "taken_for", "weight_true", "weight_best", "size_factor")


def recognition(
    item: ObjectReconstruction, true_name: str, in_prior: bool, true_half_extent: float
) -> dict[str, object]:
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
    found: dict[str, object] = {
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
