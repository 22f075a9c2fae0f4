"""Export variants of a prior's objects: stretched at random, in other colours, all different.

    python tools/export_variants.py --prior large/ --count 8804 -o variants

NAME-00000.ply, NAME-00001.ply, ... in metres, closed, with vertex colours; the objects in turn.
So a prior can be made as large as one likes, to see whether retrieval stays right. Variant NNNNN
of an object is the same whatever the count.
"""

from __future__ import annotations

import sys
from itertools import cycle, islice
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from drawn.stretched import draw_stretch
from one_message import one_message

from brrp_cli.files import write_bytes
from brrp_cli.prior.objects import PriorObject
from brrp_cli.prior.store import open_prior
from brrp_cli.seeds import child_rng

# Standard deviation of the logarithm of a gain, one for each of red, green and blue.
GAIN = 0.3


@click.command()
@click.option("--prior", "prior_path", required=True, type=click.Path(path_type=Path))
@click.option("--count", default=1000, show_default=True, type=click.IntRange(1))
@click.option("--seed", default=0, show_default=True)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@one_message()
def main(prior_path: Path, count: int, seed: int, output: Path) -> None:
    """Export COUNT variants to OUTPUT."""
    prior = open_prior(prior_path)
    for turn, name in enumerate(tqdm(islice(cycle(prior.names), count), "variants", count)):
        number = turn // len(prior.names)
        ply = variant(prior.load(name), child_rng(seed, "variant", name, number))
        write_bytes(output / f"{name}-{number:05d}.ply", ply)
    click.echo(f"{output}: {count} variants of {len(prior.names)} objects")


def variant(stored: PriorObject, rng: np.random.Generator) -> bytes:
    """A stretched and repainted mesh as PLY, metres."""
    import trimesh

    vertices = stored.shape.vertices.astype(np.float64) * stored.half_extent
    mesh = trimesh.Trimesh(
        vertices * draw_stretch(rng),
        stored.shape.faces,
        vertex_colors=repainted(stored.shape.colours, rng),
        process=False,
    )
    return bytes(mesh.export(file_type="ply"))


def repainted(colours: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Colours (n, 3) with red, green and blue exchanged, each brighter or darker by a gain."""
    gains = np.exp(rng.normal(0, GAIN, 3))
    return np.clip(colours[:, rng.permutation(3)] * gains, 0, 255).astype(np.uint8)


if __name__ == "__main__":
    main()
