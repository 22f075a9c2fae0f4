"""Objects larger than those that the networks have learned from.

A camera cannot tell a large thing far away from a small one near. So what is seen of a large object
is also what would be seen of a smaller one, and the networks are asked about that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brrp_cli.completion.visible_part import VisiblePart, visible_part


def of_usual_size(part: VisiblePart) -> tuple[VisiblePart, float]:
    """An object that looks the same and is no larger than `config.largest`, and how many times its
    lengths are those of `part`: 1 at most."""
    scale = part.config.largest / part.size
    if scale >= 1:
        return part, 1.0
    points = part.frame.points * np.float32(scale)
    plane = part.plane and replace(part.plane, offset=part.plane.offset * scale)
    smaller = visible_part(
        (part.seen * scale).astype(np.float32),
        replace(part.frame, points=points, T_world_cam=None),
        part.object_id,
        plane,
        part.config,
    )
    return smaller, scale
