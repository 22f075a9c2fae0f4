"""Two boxes, and scenes that tools/make_scenes.py makes of them."""

from __future__ import annotations

import numpy as np
import trimesh
from click.testing import CliRunner
from make_scenes import main
from PIL import Image

SIZE = "160x120"


def write_box(folder, name, extents, shift, color):
    """A textured box in YCB's layout whose origin lies far from its centre."""
    box = trimesh.creation.box(extents)
    box.apply_translation(shift)
    uv = np.full((len(box.vertices), 2), 0.5)
    material = trimesh.visual.material.SimpleMaterial(image=Image.new("RGB", (8, 8), color))
    box.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    path = folder / name / "google_16k" / "textured.obj"
    path.parent.mkdir(parents=True)
    box.export(path)


def write_two(root):
    """A red and a blue box, in meshes/."""
    write_box(root / "meshes", "001_red", (0.08, 0.06, 0.05), (0.3, 0, 0.1), (255, 0, 0))
    write_box(root / "meshes", "002_blue", (0.04, 0.04, 0.12), (0, -0.2, 0), (0, 0, 255))
    return root


def generate(data, output, *options):
    arguments = ["--meshes", data / "meshes", "--size", SIZE, "-o", output, *options]
    return CliRunner().invoke(main, [str(a) for a in arguments])


def bytes_of(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
