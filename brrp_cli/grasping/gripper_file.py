"""Grippers from YAML files: those that come with brrp, by name, and your own.

name: My hand
opening: 0.08             # metres, between the fingers
finger: {length: 0.05, width: 0.02, thickness: 0.015}
palm: {width: 0.2, depth: 0.06, length: 0.06}
force: 60                 # newtons
source: where the numbers are from
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from brrp_cli.errors import GripperError
from brrp_cli.grasping.gripper import Gripper
from brrp_cli.similar_names import most_similar_name

FOLDER = files("brrp_cli.grasping") / "grippers"
SUFFIXES = (".yaml", ".yml")
DEFAULT = "franka-hand"
# What a hand of metres can be; more is a file in millimetres.
LONGEST = 1.0
NUMBERS = {
    "opening": ("opening",),
    "finger_length": ("finger", "length"),
    "finger_width": ("finger", "width"),
    "finger_thickness": ("finger", "thickness"),
    "palm_width": ("palm", "width"),
    "palm_depth": ("palm", "depth"),
    "palm_length": ("palm", "length"),
    "force": ("force",),
}


def gripper_names() -> list[str]:
    """The grippers that come with brrp."""
    found = (path.name for path in FOLDER.iterdir())
    return sorted(name.removesuffix(".yaml") for name in found if name.endswith(".yaml"))


def open_gripper(name: str | Path) -> Gripper:
    """A gripper by name, or from a YAML file. Errors: GripperError."""
    if Path(name).suffix.lower() in SUFFIXES:
        return _read(Path(name))
    names = gripper_names()
    if str(name) not in names:
        meant = most_similar_name(str(name), names)
        hint = f"did you mean {meant}? " if meant else ""
        raise GripperError(
            "No such gripper",
            expected=f"{', '.join(names)}, or a file that ends with .yaml",
            found=name,
            fix=f"{hint}docs/grasping.md shows how to describe one more in a file",
        )
    return _read(Path(str(FOLDER / f"{name}.yaml")))


def _read(path: Path) -> Gripper:
    import yaml

    try:
        table = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise GripperError(
            "The gripper cannot be read",
            where=path,
            expected="a YAML file such as docs/grasping.md shows",
            found=error.strerror if isinstance(error, OSError) else " ".join(str(error).split()),
            fix="name a file that is there, or one of " + ", ".join(gripper_names()),
        ) from error
    if not isinstance(table, Mapping):
        raise _refused(path, "", "a table of numbers", table)
    numbers = {field: _number(path, table, place) for field, place in NUMBERS.items()}
    text = {key: str(table.get(key, "")) for key in ("name", "source")}
    return Gripper(name=text["name"] or path.stem, source=text["source"], **numbers)


def _number(path: Path, table: Mapping[str, Any], place: tuple[str, ...]) -> float:
    value: Any = table
    for key in place:
        if not isinstance(value, Mapping) or key not in value:
            raise _refused(path, ".".join(place), "a number", "nothing")
        value = value[key]
    most = math.inf if place == ("force",) else LONGEST
    what = "newtons, above 0" if place == ("force",) else f"metres, above 0 and below {LONGEST:g}"
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not good or not (0 < value < most) or not math.isfinite(value):
        raise _refused(path, ".".join(place), what, repr(value))
    return float(value)


def _refused(path: Path, place: str, expected: str, found: object) -> GripperError:
    return GripperError(
        "The gripper's file has a number that cannot be used",
        where=f"{path}: {place}" if place else path,
        expected=expected,
        found=found,
        fix="describe it as docs/grasping.md shows: opening, finger, palm and force",
    )
