"""A number that is none ends at the stage that made it, as the failure of one object."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.config import SurfaceConfig
from brrp_cli.methods.each_object import with_surface
from brrp_cli.reconstruction import FAILED, OK, TOO_FEW_POINTS, ObjectReconstruction, Retrieved


def inferred() -> ObjectReconstruction:
    """What inference says of one object that it found in a prior."""
    return ObjectReconstruction(
        3,
        OK,
        n_points=9,
        center=np.zeros(3),
        observed=np.zeros((9, 3), np.float32),
        retrieved=[
            Retrieved("can", 0.3),
            Retrieved("cup", 0.7, np.eye(4), 0.5, 20, 0.8, 0.9, 0.6),
        ],
        unknown_probability=0.1,
        unknown_weight=0.2,
    )


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("field", "stage"),
    [
        ("center", "Inference"),
        ("observed", "Inference"),
        ("unknown_probability", "Inference"),
        ("unknown_weight", "Inference"),
        ("probability", "Registration of cup"),
        ("T_cam_object", "Registration of cup"),
        ("size_factor", "Registration of cup"),
        ("fitness", "Registration of cup"),
        ("alignment_score", "Registration of cup"),
        ("weight", "Registration of cup"),
    ],
)
def test_it_is_the_failure_of_its_object(field: str, stage: str, bad: float) -> None:
    item = inferred()
    holder = item if stage == "Inference" else item.retrieved[1]
    value = getattr(holder, field)
    setattr(holder, field, np.where(np.ones_like(value), bad, value) if np.ndim(value) else bad)
    found = with_surface(3, lambda: item, SurfaceConfig())
    assert (found.object_id, found.status) == (3, FAILED)
    assert f"{stage} gave numbers that are NaN or infinite" in found.message
    assert field in found.message and found.retrieved == [] and found.surface is None


def test_whole_numbers_pass() -> None:
    assert with_surface(3, inferred, SurfaceConfig()).status == OK
    few = ObjectReconstruction(4, TOO_FEW_POINTS, "none", n_points=0)
    assert with_surface(4, lambda: few, SurfaceConfig()) is few
