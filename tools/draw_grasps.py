"""Draw a result with the best grasps of each object, from the camera's side and from behind.

brrp grasp out/
python tools/draw_grasps.py out/ -o grasps.png
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from draw_objects import towards

from brrp_cli.api import open_result
from brrp_cli.reconstruction import Surface
from brrp_cli.rendering.render import View, fitted, render, view_from_behind

SIZE = 480  # pixels of a picture
SAMPLES = 2  # rays of a pixel along each axis
GREY = 128


def hands_of(path: Path) -> list[Surface]:
    """What `brrp grasp` drew of the best grasps, in its colours."""
    found = []
    for mesh in trimesh.load_scene(path).dump():
        assert isinstance(mesh, trimesh.Trimesh)
        colours = np.asarray(mesh.visual.vertex_colors, dtype=np.uint8)[:, :3]
        none = np.zeros(len(mesh.vertices), np.float32)
        faces = np.asarray(mesh.faces, dtype=np.int64)
        found.append(Surface(np.asarray(mesh.vertices), faces, none, "m", colours))
    return found


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("result", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    result = open_result(given.result)
    surfaces = [*result.surfaces.values(), *hands_of(Path(result.folder) / "grasps.glb")]
    every = np.concatenate([surface.vertices for surface in surfaces])
    centre = (every.min(axis=0) + every.max(axis=0)) / 2
    up = -result.T_frame_cam[:3, 1] if result.plane is None else result.plane.normal
    size = SIZE * SAMPLES
    K = np.array([[size, 0, size / 2], [0, size, size / 2], [0, 0, 1.0]])
    T_cam_frame = np.linalg.inv(result.T_frame_cam).astype(np.float64)
    front = towards(View(K, T_cam_frame, (size, size)), centre)
    pictures = [picture(surfaces, view) for view in (front, view_from_behind(front, centre, up))]
    Image.fromarray(np.hstack(pictures)).save(given.output)


def picture(surfaces: list[Surface], view: View) -> NDArray[np.uint8]:
    """(SIZE, SIZE, 3) uint8, smoothed at the edges."""
    colours = [
        np.full((len(each.vertices), 3), GREY, np.uint8) if each.colours is None else each.colours
        for each in surfaces
    ]
    fine = Image.fromarray(render(surfaces, colours, fitted(view, surfaces)))
    return np.asarray(fine.resize((SIZE, SIZE), Image.Resampling.BOX))


if __name__ == "__main__":
    main()
