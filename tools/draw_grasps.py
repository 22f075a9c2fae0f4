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
from PIL import Image

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from both_sides import both_sides
from one_message import one_message

from brrp_cli.api import open_result
from brrp_cli.reconstruction import Surface

SIZE = 480  # pixels of a picture


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


@one_message()
def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("result", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    result = open_result(given.result)
    surfaces = [*result.surfaces.values(), *hands_of(Path(result.folder) / "grasps.glb")]
    pictures = both_sides(result, surfaces, SIZE)
    Image.fromarray(np.hstack(pictures)).save(given.output)


if __name__ == "__main__":
    main()
