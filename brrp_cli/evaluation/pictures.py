"""A picture of each scene: what was seen and what each method made of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from brrp_cli.config import SurfaceConfig, preset
from brrp_cli.evaluation.variants import Variant
from brrp_cli.files import atomic_path
from brrp_cli.frames.frame import Frame
from brrp_cli.methods.registry import METHODS
from brrp_cli.reconstruction import ObjectReconstruction
from brrp_cli.rendering.preview import preview
from brrp_cli.surface.extract import extract_surface


def write_picture(
    path: Path, frame: Frame, objects: Sequence[ObjectReconstruction], variant: Variant
) -> None:
    """The preview of a frame's objects, with surfaces for those that have a posterior alone."""
    from PIL import Image

    config = replace(preset("default").surface, level=METHODS[variant.method].level(variant.config))
    drawn = [_with_surface(item, config) for item in objects]
    # World z is up in the published layout; its direction in the camera frame is a row.
    up = None if frame.T_world_cam is None else frame.T_world_cam[2, :3]
    picture = preview(frame, drawn, up=up, caption=variant.label)
    with atomic_path(path) as partial:
        Image.fromarray(picture).save(partial)


def _with_surface(item: ObjectReconstruction, config: SurfaceConfig) -> ObjectReconstruction:
    if item.surface is not None or item.posterior is None or item.observed is None:
        return item
    return replace(item, surface=extract_surface(item.posterior, item.observed, config))
