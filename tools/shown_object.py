"""Which object a mask shows that was made without knowing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame


def shown_object(mask: NDArray[np.bool_], truth: Frame) -> int:
    """The object of the frame that most pixels with depth of a mask (H, W) show; 0 = none."""
    pixels = np.maximum(truth.segmap[mask & truth.valid], 0)
    return int(np.bincount(pixels).argmax()) if len(pixels) else 0
