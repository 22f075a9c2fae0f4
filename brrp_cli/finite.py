"""NaN and infinity end at the stage that made them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brrp_cli.errors import BrrpError


def check_finite(stage: str, **values: ArrayLike | None) -> None:
    """BrrpError that names the stage and the value unless all that is there is finite."""
    for name, value in values.items():
        if value is not None and not np.isfinite(value).all():
            raise BrrpError(
                f"{stage} gave numbers that are NaN or infinite",
                found=name,
                fix="look at the object's depth and mask; tell us if they are as they should be",
            )
