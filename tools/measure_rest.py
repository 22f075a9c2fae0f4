"""How still the scenes lie that `brrp export` writes: MuJoCo, three seconds, nobody touches them.

    brrp export out/ --no-rest -o before/
    brrp export out/ -o after/
    python tools/measure_rest.py before=before/ after=after/

Each argument is NAME=FOLDER, where FOLDER is one plan or holds several. For each name: the share of
objects that move by less than 5 mm and 5 degrees in three seconds, the deepest overlap of two
objects at the start, and the corrections that plan.json tells.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

SECONDS = 3.0
LIMIT_MM, LIMIT_DEGREES = 5.0, 5.0


@dataclass(frozen=True)
class Stillness:
    """Of one object, mm and degrees. moved, turned : in three seconds; overlap : with its
    neighbours, at the start; shifted, tilted : by brrp export, against where it was measured."""

    plan: str
    name: str
    moved: float
    turned: float
    overlap: float
    shifted: float
    tilted: float

    @property
    def rests(self) -> bool:
        """Whether it stays within the limits."""
        return self.moved < LIMIT_MM and self.turned < LIMIT_DEGREES


@click.command()
@click.argument("sets", nargs=-1, required=True, metavar="NAME=FOLDER...")
@click.option("--each", is_flag=True, help="Also a line for each object that does not rest.")
def main(sets: tuple[str, ...], each: bool) -> None:
    """Simulate what lies in folders of `brrp export` and tell how much of it rests."""
    found: dict[str, list[Stillness]] = {}
    for text in sets:
        name, _, folder = text.partition("=")
        plans = sorted(path.parent for path in Path(folder).rglob("plan.json"))
        if not plans:
            raise click.ClickException(f"no plan.json below {folder}")
        found.setdefault(name, []).extend(item for plan in plans for item in stillness(plan))
    click.echo(report(found))
    if each:
        for name, items in found.items():
            for item in items:
                if not item.rests:
                    click.echo(f"{name} {item}")


def report(found: dict[str, list[Stillness]]) -> str:
    """A table in Markdown, one line for each name."""
    lines = [
        "| scenes | objects | rest | moved, median, 90 %, worst | turned, worst "
        "| deepest overlap | corrected, median, 90 %, worst |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, items in found.items():
        moved = [item.moved for item in items]
        shifted = [item.shifted for item in items]
        tilted = [item.tilted for item in items]
        told = "-"
        if not np.isnan(shifted).all():
            told = f"{_three(shifted)} mm; {_three(tilted)}°"
        lines.append(
            f"| {name} | {len(items)} | {np.mean([item.rests for item in items]):.0%} "
            f"| {_three(moved)} mm | {max(item.turned for item in items):.0f}° "
            f"| {max(item.overlap for item in items):.1f} mm | {told} |"
        )
    return "\n".join(lines)


def stillness(plan: Path) -> list[Stillness]:
    """One for each object of a plan."""
    import mujoco

    record = json.loads((plan / "plan.json").read_text())
    model = mujoco.MjModel.from_xml_path(str(plan / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [item["name"] for item in record["objects"]]
    overlap = dict.fromkeys(names, 0.0)
    for contact in data.contact[: data.ncon]:
        pair = [model.body(model.geom_bodyid[geom]).name for geom in contact.geom]
        if set(pair) <= set(names):
            for name in pair:
                overlap[name] = max(overlap[name], -1000 * float(contact.dist))
    first = {name: _place(data, name) for name in names}
    while data.time < SECONDS:
        mujoco.mj_step(model, data)
    found = []
    for item in record["objects"]:
        name = item["name"]
        moved, turned = _between(first[name], _place(data, name))
        rest = item.get("rest") or {}
        found.append(
            Stillness(
                str(plan),
                name,
                moved,
                turned,
                overlap[name],
                rest.get("moved_mm", np.nan),
                rest.get("turned_degrees", np.nan),
            )
        )
    return found


def _place(data: Any, name: str) -> tuple[np.ndarray, np.ndarray]:
    body = data.body(name)
    return body.xpos.copy(), body.xmat.reshape(3, 3).copy()


def _between(
    first: tuple[np.ndarray, np.ndarray], last: tuple[np.ndarray, np.ndarray]
) -> tuple[float, float]:
    cosine = (np.trace(first[1].T @ last[1]) - 1) / 2
    turned = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    return 1000 * float(np.linalg.norm(last[0] - first[0])), turned


def _three(values: list[float]) -> str:
    return ", ".join(f"{v:.1f}" for v in np.nanpercentile(values, [50, 90, 100]))


if __name__ == "__main__":
    main()
