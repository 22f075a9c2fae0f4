"""NaN and infinity end at the stage that made them, as the failure of one object."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from brrp_cli.errors import BrrpError

if TYPE_CHECKING:
    from brrp_cli.reconstruction import ObjectReconstruction


def check_finite(stage: str, **values: ArrayLike | None) -> None:
    """BrrpError that names the stage and the value unless all that is there is finite."""
    for name, value in values.items():
        if value is not None and not np.isfinite(value).all():
            raise BrrpError(
                f"{stage} gave numbers that are NaN or infinite",
                found=name,
                fix="look at the object's depth and mask; tell us if they are as they should be",
            )


def check_object(item: ObjectReconstruction) -> None:
    """The same for all that inference says of one object, apart from its posterior, which is asked
    where the surface is looked for."""
    check_finite(
        "Inference",
        center=item.center,
        observed=item.observed,
        unknown_probability=item.unknown_probability,
        unknown_weight=item.unknown_weight,
    )
    for found in item.retrieved:
        check_finite(
            f"Registration of {found.name}",
            probability=found.probability,
            T_cam_object=found.T_cam_object,
            scale=found.scale,
            fitness=found.fitness,
            alignment_score=found.alignment_score,
            weight=found.weight,
        )
