"""Export shapes drawn at random as closed meshes in metres.

    python tools/export_drawn_shapes.py --count 150 --seed 5000 -o household
    python tools/export_drawn_shapes.py --kind composed --count 200 -o composed

household: hNNN_KIND.obj, boxes, cans, bottles, mugs, bowls, plates, tools and fruit of
`tools/drawn/household.py`, of random dimensions. composed: cNNN.obj, solids of no kind, a few parts
that run into each other. plain: pNNN.obj, boxes, cylinders, prisms, cones and ellipsoids, from
5 to 25 cm long. Each is drawn from its own random numbers, so that shape NNN of a seed is
the same whatever the count.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from drawn.composed import draw_composed_shape
from drawn.household import draw_household_shape
from drawn.plain import draw_plain_shape
from one_message import one_message

from brrp_cli.files import write_bytes
from brrp_cli.seeds import child_rng


def _household(seed: int, number: int) -> tuple[str, Any]:
    kind, mesh = draw_household_shape(child_rng(seed, "household", number))
    return f"h{number:03d}_{kind}", mesh


def _composed(seed: int, number: int) -> tuple[str, Any]:
    return f"c{number:03d}", draw_composed_shape(child_rng(seed, "composed", number))


def _plain(seed: int, number: int) -> tuple[str, Any]:
    return f"p{number:03d}", draw_plain_shape(child_rng(seed, "plain", number))


KINDS = {"household": _household, "composed": _composed, "plain": _plain}


@click.command()
@click.option("--kind", default="household", show_default=True, type=click.Choice(list(KINDS)))
@click.option("--count", default=150, show_default=True, type=click.IntRange(1, 1000))
@click.option("--seed", default=0, show_default=True)
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path))
@one_message()
def main(kind: str, count: int, seed: int, output: Path) -> None:
    """Export COUNT shapes to OUTPUT."""
    for number in tqdm(range(count), desc="shapes"):
        name, mesh = KINDS[kind](seed, number)
        write_bytes(output / f"{name}.obj", str(mesh.export(file_type="obj")).encode())
    click.echo(f"{output}: {count} shapes")


if __name__ == "__main__":
    main()
