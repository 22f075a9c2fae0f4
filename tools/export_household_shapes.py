"""Export household shapes of random dimensions as closed meshes in metres, one hNNN_KIND.obj each.

    python tools/export_household_shapes.py --count 150 --seed 5000 -o other_shapes

Boxes, cans, bottles, mugs, bowls, plates, tools and fruit of `brrp_cli/shapes`, each drawn from its
own random numbers, so that shape NNN of a seed is the same whatever the count.
"""

from __future__ import annotations

import sys
from pathlib import Path

import click
from tqdm import tqdm

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from brrp_cli.errors import BrrpError
from brrp_cli.files import write_bytes
from brrp_cli.seeds import child_rng
from brrp_cli.shapes.drawn import draw_household_shape


@click.command()
@click.option("--count", default=150, show_default=True, type=click.IntRange(1, 1000))
@click.option("--seed", default=0, show_default=True)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
def main(count: int, seed: int, output: Path) -> None:
    """Export COUNT shapes to OUTPUT."""
    try:
        for number in tqdm(range(count), desc="shapes"):
            kind, mesh = draw_household_shape(child_rng(seed, "household", number))
            text = str(mesh.export(file_type="obj"))
            write_bytes(output / f"h{number:03d}_{kind}.obj", text.encode())
    except BrrpError as error:
        raise click.ClickException(str(error)) from error
    click.echo(f"{output}: {count} shapes")


if __name__ == "__main__":
    main()
