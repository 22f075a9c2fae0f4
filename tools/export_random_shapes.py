"""Export PyBullet's random shapes as closed meshes in metres, one NNN.obj each.

    python tools/export_random_shapes.py --count 100 -o random_shapes
    python tools/export_random_shapes.py --first 100 --count 300 -o other_shapes

The thousand shapes of pybullet_data/random_urdfs (9 to 12 cm long, made of blocks) come as convex
parts with gaps of a fraction of a millimetre between them. Each part is grown by half a gap and
the parts are united, so that inside and outside are defined: overlapping or parted shells would
not tell an evaluation what the true occupancy is. Shapes that do not become one closed body are
left out and counted. Needs `pip install .[sim]`.
"""

from __future__ import annotations

import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
import numpy as np
from tqdm import tqdm

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.dependencies import import_library
from brrp_cli.errors import MeshError
from brrp_cli.files import write_bytes

GROWTH = (0.0002, 0.0004, 0.0008)  # metres on each side; the first that closes the gaps


@click.command()
@click.option("--count", default=100, show_default=True, type=click.IntRange(1, 1000))
@click.option("--first", default=0, show_default=True, type=click.IntRange(0, 999))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@one_message()
def main(count: int, first: int, output: Path) -> None:
    """Export COUNT shapes, from number FIRST on, to OUTPUT."""
    data = Path(import_library("pybullet_data").getDataPath()) / "random_urdfs"
    left_out = 0
    numbers = range(first, min(first + count, 1000))
    for number in tqdm(numbers, desc="shapes"):
        solid = one_solid(read_parts(data / f"{number:03d}"))
        if solid is None:
            left_out += 1
        else:
            write_bytes(output / f"{number:03d}.obj", solid.encode())
    click.echo(f"{output}: {len(numbers) - left_out} shapes, {left_out} left out")


def read_parts(folder: Path) -> list[Any]:
    """The convex parts of NNN/NNN.obj as trimesh.Trimesh, scaled as NNN.urdf says; flat ones, which
    enclose nothing, are left out."""
    import trimesh
    from scipy.spatial import QhullError

    urdf = (folder / f"{folder.name}.urdf").read_text()
    scale = re.search(r'<mesh filename="[^"]*" scale="([^"]*)"', urdf)
    if scale is None:
        raise MeshError("The shape has no scale", where=folder / f"{folder.name}.urdf")
    loaded: Any = trimesh.load(folder / f"{folder.name}.obj", force="mesh", skip_materials=True)
    mesh = trimesh.Trimesh(loaded.vertices, loaded.faces)
    mesh.apply_scale([float(factor) for factor in scale[1].split()])
    parts = []
    for part in mesh.split(only_watertight=False):
        with suppress(QhullError):
            parts.append(part.convex_hull)
    return parts


def one_solid(parts: list[Any]) -> str | None:
    """The union of convex parts, grown until their gaps close, as OBJ; None if in pieces."""
    import manifold3d
    import trimesh

    corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, 8).T
    for growth in GROWTH:
        grown = [
            # Minkowski sum of a convex part and a cube.
            manifold3d.Manifold.hull_points(
                (part.vertices[:, None] + growth * corners[None]).reshape(-1, 3)
            )
            for part in parts
        ]
        union = manifold3d.Manifold.batch_boolean(grown, manifold3d.OpType.Add)
        # Slivers thinner than the gaps would fall shut when the file rounds its numbers.
        simplified = union.simplify(growth)
        if simplified.is_empty():
            continue
        mesh = simplified.to_mesh64()
        text = str(trimesh.Trimesh(mesh.vert_properties, mesh.tri_verts).export(file_type="obj"))
        written: Any = trimesh.load(
            trimesh.util.wrap_as_stream(text), file_type="obj", force="mesh"
        )
        if written.is_watertight and len(written.split(only_watertight=False)) == 1:
            return text
    return None


if __name__ == "__main__":
    main()
