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
    return (part, 1.0) if scale >= 1 else (resized(part, scale), scale)


def resized(part: VisiblePart, scale: float) -> VisiblePart:
    """What would be seen of an object, and of all around it, with `scale` times all lengths."""
    points = part.frame.points * np.float32(scale)
    return visible_part(
        (part.seen * scale).astype(np.float32),
        replace(part.frame, points=points, T_world_cam=None),
        part.object_id,
        part.plane and replace(part.plane, offset=part.plane.offset * scale),
        part.config,
    )
