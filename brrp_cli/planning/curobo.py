"""cuRobo's world file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.planning.body import Body
from brrp_cli.planning.mjcf import FURNITURE_COLOUR, TableBox
from brrp_cli.planning.numbers import quaternion_wxyz
from brrp_cli.planning.union import union_of_hulls


def curobo_world(bodies: Mapping[str, Body], table: TableBox | None, frame: str) -> str:
    """YAML for `curobo.geom.types.WorldConfig.from_dict`: a mesh for each body and each bin, a
    cuboid as table.

    Poses are x y z qw qx qy qz in metres. The meshes stand in the file itself: cuRobo looks for
    files below a folder of its own. A body's parts are joined into one closed surface, since cuRobo
    tells inside from outside by counting the faces that a ray crosses.
    """
    lines = [f"# metres; poses are x y z qw qx qy qz in the {frame} frame of the results"]
    if table is not None:
        lines += [
            "cuboid:",
            "  table:",
            f"    dims: {_row(table.size)}",
            f"    pose: {_pose(table.T_frame_table)}",
        ]
    lines.append("mesh:")
    for name, body in bodies.items():
        lines += _mesh(name, body.T_frame_body, body.colour, body.parts)
    for name, walls in ({} if table is None else table.furniture).items():
        lines += _mesh(name, np.eye(4), FURNITURE_COLOUR, walls)
    return "\n".join(lines) + "\n"


def _mesh(
    name: str,
    T: NDArray[np.float64],
    colour: Iterable[float],
    parts: Sequence[NDArray[np.float64]],
) -> list[str]:
    vertices, faces = union_of_hulls(parts)
    return [
        f"  {name}:",
        f"    pose: {_pose(T)}",
        f"    color: {_row([*colour, 1.0])}",
        "    vertices:",
        *(f"    - {_row(vertex)}" for vertex in vertices),
        "    faces:",
        *(f"    - [{a}, {b}, {c}]" for a, b, c in faces),
    ]


def _pose(T: NDArray[np.float64]) -> str:
    return _row([*T[:3, 3], *quaternion_wxyz(T[:3, :3])])


def _row(values: Iterable[float]) -> str:
    # Fixed point: YAML 1.1 takes 1e-05, without a point in it, for a string.
    return "[" + ", ".join(f"{float(np.round(v, 7)) + 0.0:.7f}" for v in values) + "]"
