"""How still the scenes lie that `brrp export` writes: three seconds in which nobody touches them.

    brrp export out/ --no-rest -o before/
    brrp export out/ -o after/
    python tools/measure_rest.py before=before/ after=after/

Each argument is NAME=FOLDER, where FOLDER is one plan or holds several. For each name: the share of
objects that move by less than 5 mm and 5 degrees in three seconds, the deepest overlap of two
objects at the start, and the corrections that plan.json tells. The simulator is MuJoCo, with
scene.xml, or PyBullet, with the URDFs at their places on a box.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

# The script also runs from a checkout that is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from one_message import one_message

from brrp_cli.geometry import rotation_angle
from brrp_cli.planning.numbers import quaternion_wxyz

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
@click.option(
    "--simulator", type=click.Choice(["mujoco", "pybullet"]), default="mujoco", show_default=True
)
@click.option("--each", is_flag=True, help="Also a line for each object that does not rest.")
@one_message()
def main(sets: tuple[str, ...], simulator: str, each: bool) -> None:
    """Simulate what lies in folders of `brrp export` and tell how much of it rests."""
    found: dict[str, list[Stillness]] = {}
    for text in sets:
        name, _, folder = text.partition("=")
        plans = sorted(path.parent for path in Path(folder).rglob("plan.json"))
        if not plans:
            raise click.ClickException(f"no plan.json below {folder}")
        run = stillness if simulator == "mujoco" else stillness_in_pybullet
        found.setdefault(name, []).extend(item for plan in plans for item in run(plan))
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
    """One for each object of a plan, in MuJoCo."""
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
    last = {name: _place(data, name) for name in names}
    return _told(plan, record, first, last, overlap)


def stillness_in_pybullet(plan: Path) -> list[Stillness]:
    """The same with each URDF where it rests, or was measured, on a box under a scene of its
    own."""
    import pybullet as bullet

    record = json.loads((plan / "plan.json").read_text())
    client = bullet.connect(bullet.DIRECT)
    try:
        table = record["table"]
        half = [edge / 2 for edge in table["size"]]
        shape = bullet.createCollisionShape(
            bullet.GEOM_BOX, halfExtents=half, physicsClientId=client
        )
        ground = bullet.createMultiBody(0, shape, -1, *_bullet(table["T_frame_table"]))
        bullet.changeDynamics(ground, -1, lateralFriction=1.0)
        bullet.setGravity(*(-9.81 * np.array(record["up"])), physicsClientId=client)
        ids = {}
        for item in record["objects"]:
            T = (item.get("rest") or item)["T_frame_body"]
            ids[item["name"]] = bullet.loadURDF(str(plan / item["urdf"]), *_bullet(T))
        overlap = dict.fromkeys(ids, 0.0)
        for name, one in ids.items():
            for other in ids.values():
                near = bullet.getClosestPoints(one, other, 0.0) if other != one else ()
                overlap[name] = max([overlap[name], *(-1000 * point[8] for point in near)])
        first = {name: _bullet_place(bullet, one) for name, one in ids.items()}
        for _ in range(round(240 * SECONDS)):
            bullet.stepSimulation(client)
        last = {name: _bullet_place(bullet, one) for name, one in ids.items()}
    finally:
        bullet.disconnect(client)
    return _told(plan, record, first, last, overlap)


def _told(
    plan: Path,
    record: dict[str, Any],
    first: dict[str, Any],
    last: dict[str, Any],
    overlap: dict[str, float],
) -> list[Stillness]:
    found = []
    for item in record["objects"]:
        name, rest = item["name"], item.get("rest") or {}
        moved = _between(first[name], last[name])
        corrected = (rest.get("moved_mm", np.nan), rest.get("turned_degrees", np.nan))
        found.append(Stillness(str(plan), name, *moved, overlap[name], *corrected))
    return found


def _bullet(T: list[list[float]]) -> tuple[list[float], list[float]]:
    """Position and quaternion x y z w of T (4, 4)."""
    w, x, y, z = quaternion_wxyz(np.array(T)[:3, :3])
    return [row[3] for row in T[:3]], [x, y, z, w]


def _bullet_place(bullet: Any, body: int) -> tuple[np.ndarray, np.ndarray]:
    place, turn = bullet.getBasePositionAndOrientation(body)
    return np.array(place), np.array(bullet.getMatrixFromQuaternion(turn)).reshape(3, 3)


def _place(data: Any, name: str) -> tuple[np.ndarray, np.ndarray]:
    body = data.body(name)
    return body.xpos.copy(), body.xmat.reshape(3, 3).copy()


def _between(
    first: tuple[np.ndarray, np.ndarray], last: tuple[np.ndarray, np.ndarray]
) -> tuple[float, float]:
    turned = rotation_angle(first[1].T @ last[1])
    return 1000 * float(np.linalg.norm(last[0] - first[0])), float(np.degrees(turned))


def _three(values: list[float]) -> str:
    return ", ".join(f"{v:.1f}" for v in np.nanpercentile(values, [50, 90, 100]))


if __name__ == "__main__":
    main()
