"""What stands on the table, or about it, and is background."""

from __future__ import annotations

import colorsys
import json
from pathlib import Path
from typing import Protocol

import numpy as np
import trimesh

from brrp_cli.errors import SceneError
from tabletop.settle import Panel, rotation

# In the folder of a scene: of which kind it is, its floor and its walls, boxes in the world.
FILE = "furniture.json"


class Furniture(Protocol):
    """A platform, a bin, a wall or a shelf."""

    @property
    def color(self) -> tuple[float, float, float]:
        """(3,), 0 to 1."""

    @property
    def ground(self) -> Panel:
        """What lies beneath: the table, or a floor."""

    def panels(self) -> list[Panel]:
        """Its boxes, metres, world; what objects stand on comes first, where it has that."""


def any_color(rng: np.random.Generator) -> tuple[float, float, float]:
    """(3,), 0 to 1: neither black nor shining."""
    hue, saturation, value = rng.random(3)
    return colorsys.hsv_to_rgb(hue, 0.9 * saturation, 0.15 + 0.75 * value)


def write_furniture(furniture: Furniture, folder: Path) -> None:
    """Write what objects of a scene stand in."""
    panels = [
        {
            "position": panel.position.tolist(),
            "orientation": np.asarray(panel.orientation).tolist(),
            "half": panel.half.tolist(),
        }
        for panel in furniture.panels()
    ]
    record = {"kind": type(furniture).__name__.lower(), "panels": panels}
    (folder / FILE).write_text(json.dumps(record, indent=2) + "\n")


def read_walls(folder: Path) -> tuple[str, list[trimesh.Trimesh]]:
    """The kind of a scene's furniture, and all of it but a floor within walls: boxes, metres,
    world. Errors: SceneError for a scene without."""
    path = folder / FILE
    if not path.is_file():
        raise SceneError(
            "The scene has no bin, no platform and no shelf",
            where=path,
            expected="a scene that tools/make_scenes.py made with --bin, --platform or --shelf",
            fix="make it anew, with the same options, one of these and --overwrite",
        )
    record = json.loads(path.read_text())
    meshes = []
    panels = record["panels"]
    for wall in panels[1:] or panels:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotation(np.array(wall["orientation"])), wall["position"]
        meshes.append(trimesh.creation.box(2 * np.array(wall["half"]), T))
    return record["kind"], meshes
