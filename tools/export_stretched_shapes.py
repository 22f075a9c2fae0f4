"""Export meshes stretched at random along their axes, as closed meshes in metres.

    python tools/export_stretched_shapes.py HOUSEHOLD/ --held-out leave --copies 2 -o stretched

NAME~1.ply, NAME~2.ply, ... of each mesh that can be closed: what a completion learns from when
there are few objects of a kind. A mug that is twice as wide is a mug as well.
"""

from __future__ import annotations

import sys
from pathlib import Path

import click
import numpy as np
from tqdm import tqdm

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from drawn.stretched import draw_stretch
from one_message import one_message
from tabletop.held_out import LEAVE, MIXED, TAKE, chosen
from tabletop.models import find_meshes
from tabletop.names_option import prefixes
from training.completion_examples import STRETCHED

from brrp_cli.errors import MeshError
from brrp_cli.files import write_bytes
from brrp_cli.ground_truth.truth import TrueObject, true_mesh
from brrp_cli.prior.build.repair import repair
from brrp_cli.seeds import child_rng


@click.command()
@click.argument("meshes", type=click.Path(path_type=Path))
@click.option("--skip", default="", callback=prefixes, help="Names to leave out, as in 030,065-b.")
@click.option("--held-out", default=MIXED, type=click.Choice([MIXED, LEAVE, TAKE]))
@click.option("--copies", default=2, show_default=True, type=click.IntRange(1))
@click.option("--seed", default=0, show_default=True)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@one_message()
def main(
    meshes: Path, skip: tuple[str, ...], held_out: str, copies: int, seed: int, output: Path
) -> None:
    """Export COPIES of each of MESHES to OUTPUT."""
    left_out = 0
    paths = chosen(find_meshes(meshes, (), skip), held_out)
    for path in tqdm(paths, desc="meshes"):
        true = TrueObject(0, str(path.relative_to(meshes)), np.eye(4))
        try:
            solid = repair(true_mesh(true, meshes)).mesh
        except MeshError:
            left_out += 1
            continue
        for copy in range(1, copies + 1):
            rng = child_rng(seed, "stretched", true.name, copy)
            mesh = solid.copy()
            mesh.apply_scale(draw_stretch(rng))
            name = f"{true.name}{STRETCHED}{copy}.ply"
            write_bytes(output / name, mesh.export(file_type="ply"))
    click.echo(f"{output}: {(len(paths) - left_out) * copies} shapes, {left_out} meshes left out")


if __name__ == "__main__":
    main()
