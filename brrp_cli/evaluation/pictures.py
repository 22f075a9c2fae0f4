"""A picture of each scene: what was seen and what each method made of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from brrp_cli.evaluation.variants import Variant
from brrp_cli.files import atomic_path
from brrp_cli.frames.frame import Frame
from brrp_cli.reconstruction import ObjectReconstruction
from brrp_cli.rendering.preview import preview


def write_picture(
    path: Path, frame: Frame, objects: Sequence[ObjectReconstruction], variant: Variant
) -> None:
    """The preview of a frame's objects."""
    from PIL import Image

    # World z is up in the published layout; its direction in the camera frame is a row.
    up = None if frame.T_world_cam is None else frame.T_world_cam[2, :3]
    picture = preview(frame, objects, up=up, caption=variant.label)
    with atomic_path(path) as partial:
        Image.fromarray(picture).save(partial)
