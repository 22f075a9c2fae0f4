"""MJCF, MuJoCo's format: of one body, and of all of them on their table."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.planning import RestConfig
from brrp_cli.physics import GRAVITY
from brrp_cli.planning.body import Body, lift_onto
from brrp_cli.planning.numbers import quaternion_wxyz, spell

# Meshes are drawn from group 2 and collide in group 3, as MuJoCo's viewer expects it.
VISUAL, COLLISION = "2", "3"
FURNITURE_COLOUR = (0.6, 0.6, 0.65)  # RGB, 0 to 1
TABLE_COLOUR = (0.7, 0.66, 0.6, 1.0)  # RGBA


@dataclass(frozen=True)
class TableBox:
    """A box whose top is the support plane, what stands on it, and what shuts it off.

    T_frame_table : (4, 4) of the box's centre, z its normal; size : (3,) metres, edge to edge
    bins, walls, platforms : by name, corners (k, 3) of the solids of each, convex, metres, frame of
    the results
    """

    T_frame_table: NDArray[np.float64]
    size: NDArray[np.float64]
    bins: Mapping[str, Sequence[NDArray[np.float64]]] = field(default_factory=dict)
    walls: Mapping[str, Sequence[NDArray[np.float64]]] = field(default_factory=dict)
    platforms: Mapping[str, Sequence[NDArray[np.float64]]] = field(default_factory=dict)

    @property
    def furniture(self) -> dict[str, Sequence[NDArray[np.float64]]]:
        """Bins, platforms and walls, by name."""
        return {**self.bins, **self.platforms, **self.walls}

    @property
    def up(self) -> NDArray[np.float64]:
        """(3,) normal of its top."""
        return np.asarray(self.T_frame_table[:3, 2])

    @property
    def offset(self) -> float:
        """Of its top: up . x + offset = 0."""
        return float(-self.up @ self.T_frame_table[:3, 3] - self.size[2] / 2)


@dataclass(frozen=True)
class Files:
    """Where a body's meshes lie, beside the file that names them."""

    mesh: str
    parts: Sequence[str]


def body_mjcf(body: Body, files: Files, config: RestConfig) -> str:
    """A model of one free body at the origin."""
    model, assets, world = _model(body.name, np.array([0.0, 0.0, -GRAVITY]), config)
    _add_body(assets, world, body, files, np.eye(4))
    return _text(model)


def scene_mjcf(
    bodies: Mapping[str, Body],
    files: Mapping[str, Files],
    table: TableBox | None,
    config: RestConfig,
    poses: Mapping[str, NDArray[np.float64]] | None = None,
) -> str:
    """A model of all bodies, free, on the table, in the frame of the results. Gravity is along the
    table's normal; without a table there is none.

    poses : T_frame_body by name; None: their own, and a body whose collision shape reaches below
    the table's top is put on top of it
    """
    gravity = np.zeros(3) if table is None else -GRAVITY * table.up
    model, assets, world = _model("scene", gravity, config)
    if table is not None:
        place = ET.SubElement(world, "body", {"name": "table", **_pose(table.T_frame_table)})
        half = spell(table.size / 2)
        ET.SubElement(place, "geom", name="table", type="box", size=half, rgba=spell(TABLE_COLOUR))
        for name, walls in table.furniture.items():
            _add_furniture(assets, world, name, walls)
    for name, body in bodies.items():
        T = body.T_frame_body.copy() if poses is None else poses[name]
        if table is not None and poses is None:
            lift = lift_onto(body, table.up, table.offset)
            T[:3, 3] += (lift + config.clearance if lift > 0 else 0.0) * table.up
        _add_body(assets, world, body, files[name], T)
    return _text(model)


def _model(
    name: str, gravity: NDArray[np.float64], config: RestConfig
) -> tuple[ET.Element, ET.Element, ET.Element]:
    model = ET.Element("mujoco", model=name)
    ET.SubElement(model, "compiler", angle="radian")
    # MuJoCo's manual: such cones and this ratio keep what friction holds from creeping.
    ET.SubElement(
        model,
        "option",
        gravity=spell(gravity),
        integrator="implicitfast",
        cone="elliptic",
        impratio="10",
    )
    default = ET.SubElement(model, "default")
    friction = spell([config.friction, config.torsion, config.rolling])
    solref = spell([config.contact_time, 1])
    ET.SubElement(default, "geom", condim="6", friction=friction, solref=solref)
    assets = ET.SubElement(model, "asset")
    world = ET.SubElement(model, "worldbody")
    up = -gravity if np.any(gravity) else np.array([0.0, 0.0, 1.0])
    ET.SubElement(world, "light", pos=spell(2 * up), dir=spell(-up), directional="true")
    return model, assets, world


def solid_name(name: str, number: int) -> str:
    """Of one wall of a bin, or of one that stands alone."""
    return f"{name}_wall_{number}" if name.startswith("bin") else name


def _add_furniture(
    assets: ET.Element, world: ET.Element, name: str, walls: Sequence[NDArray[np.float64]]
) -> None:
    """It stands where it is. MuJoCo makes the hulls of its walls' corners."""
    place = ET.SubElement(world, "body", name=name)
    for number, wall in enumerate(walls):
        own = solid_name(name, number)
        ET.SubElement(assets, "mesh", name=own, vertex=spell(wall.ravel()))
        ET.SubElement(
            place, "geom", name=own, type="mesh", mesh=own, rgba=spell([*FURNITURE_COLOUR, 1.0])
        )


def _add_body(
    assets: ET.Element, world: ET.Element, body: Body, files: Files, T: NDArray[np.float64]
) -> None:
    """Collision parts are hulls already, so that MuJoCo's own hulls change nothing."""
    element = ET.SubElement(world, "body", {"name": body.name, **_pose(T)})
    ET.SubElement(element, "freejoint", name=f"{body.name}_free")
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
    inertia = spell([xx, yy, zz, xy, xz, yz])
    ET.SubElement(element, "inertial", pos="0 0 0", mass=spell([body.mass]), fullinertia=inertia)
    ET.SubElement(assets, "mesh", name=body.name, file=files.mesh)
    ET.SubElement(
        element,
        "geom",
        name=f"{body.name}_visual",
        type="mesh",
        mesh=body.name,
        group=VISUAL,
        contype="0",
        conaffinity="0",
        rgba=spell([*body.colour, 1.0]),
    )
    for i, file in enumerate(files.parts):
        part = f"{body.name}_part_{i}"
        ET.SubElement(assets, "mesh", name=part, file=file)
        ET.SubElement(
            element, "geom", name=part, type="mesh", mesh=part, group=COLLISION, rgba="0 0 0 0"
        )


def _pose(T: NDArray[np.float64]) -> dict[str, str]:
    return {"pos": spell(T[:3, 3]), "quat": spell(quaternion_wxyz(T[:3, :3]))}


def _text(model: ET.Element) -> str:
    ET.indent(model)
    return ET.tostring(model, encoding="unicode") + "\n"
