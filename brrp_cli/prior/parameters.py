"""What decides the bytes of a prior, apart from the meshes themselves."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, is_dataclass
from typing import Any

from brrp_cli.config import FeatureConfig
from brrp_cli.errors import PriorError

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}


@dataclass(frozen=True)
class SampleMix:
    """Where labelled samples lie. Lengths are normalised: the object's largest half-extent is 1.

    A share of `uniform` fills the cube of half-width `reach` around the object; the rest is split
    evenly over `offsets`: points of the surface moved by Gaussian noise of that standard deviation.
    The cube is as wide as a map around a small object: where no sample says that space is free,
    particles keep what they started from.
    """

    uniform: float = 0.75
    reach: float = 4.0
    offsets: tuple[float, ...] = (0.1, 0.025)


@dataclass(frozen=True)
class PoseConfig:
    """Which resting poses are kept.

    hull_faces : at most, of the hull that an object rests on; tolerance : by how much that hull may
        lie off at first, times the diagonal of the object's box; growth : of that, as often as ways
        to fall are lost; complete : probability of all ways to fall that are not, at least
    """

    hull_faces: int = 400
    tolerance: float = 1e-4
    growth: float = 1.5
    complete: float = 0.999
    merge_degrees: float = 10.0
    min_probability: float = 0.01
    max_count: int = 12


@dataclass(frozen=True)
class AppearanceConfig:
    """How meshes are looked at for their appearance: directions, and rays for each."""

    views: int = 32
    rays: int = 3_000


@dataclass(frozen=True)
class FieldConfig:
    """The grid of signed distances: its nodes, and how far it reaches beyond the bounding box,
    normalised."""

    nodes: int = 60_000
    margin: float = 0.1


@dataclass(frozen=True)
class RepairConfig:
    """How open meshes are closed; shares of the mesh's diagonal.

    small_hole : a hole whose rim is shorter across is a flaw, not a shape
    alpha : the wrap's probe enters every opening that is wider; offset : its surface lies so far
    outside, before it is laid onto the mesh
    wall : what is left around a sheet, so that one of 25 cm becomes a wall of 1.25 mm
    spanning : no share, a cosine between the way to the mesh's nearest point and the way inward;
    below it the wrap spans an opening, and the nearest point is on its rim
    """

    small_hole: float = 0.1
    alpha: float = 0.02
    offset: float = 0.005
    wall: float = 0.005
    spanning: float = 0.5


@dataclass(frozen=True)
class ColoursConfig:
    """Colours of vertices from a texture: those of `cuts` ** 2 places on each face are fitted, in
    `steps` steps."""

    cuts: int = 2
    steps: int = 8


@dataclass(frozen=True)
class MeshConfig:
    """The mesh that is kept: its faces are divided until no edge is longer than `edge`, a share of
    the largest half-extent, as long as there are no more than `faces` of them."""

    edge: float = 0.05
    faces: int = 40_000
    colours: ColoursConfig = field(default_factory=ColoursConfig)


@dataclass(frozen=True)
class BuildParameters:
    """All of it. `units`: what one unit of the mesh files is."""

    seed: int = 0
    units: str = "m"
    samples: int = 20_000
    mix: SampleMix = field(default_factory=SampleMix)
    surface_points: int = 4_000
    dense_points: int = 20_000
    features: FeatureConfig = field(default_factory=FeatureConfig)
    repair: RepairConfig = field(default_factory=RepairConfig)
    poses: PoseConfig = field(default_factory=PoseConfig)
    appearance: AppearanceConfig = field(default_factory=AppearanceConfig)
    mesh: MeshConfig = field(default_factory=MeshConfig)
    distances: FieldConfig = field(default_factory=FieldConfig)

    def as_dict(self) -> dict[str, Any]:
        """As JSON gives it back: tuples are lists."""
        plain: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return plain


def restore_parameters(table: Mapping[str, Any], where: object) -> BuildParameters:
    """The parameters that `as_dict` made a table of. Errors: PriorError for those of a brrp with
    other ones."""
    try:
        restored: BuildParameters = _restored(BuildParameters, table)
        same = restored.as_dict() == table
    except (TypeError, ValueError, KeyError):
        same = False
    if not same:
        raise PriorError(
            "The prior was built by a brrp with other parameters",
            where=where,
            found="; ".join(differences(BuildParameters().as_dict(), table)[:5]),
            fix="build it anew: brrp build-prior MESHES/ --overwrite",
        )
    return restored


def _restored(kind: Any, table: Mapping[str, Any]) -> Any:
    values = dict(table)
    for name, default in vars(kind()).items():
        if is_dataclass(default):
            values[name] = _restored(type(default), values[name])
        elif isinstance(default, tuple):
            values[name] = tuple(values[name])
    return kind(**values)


def differences(old: Mapping[str, Any], new: Mapping[str, Any], prefix: str = "") -> list[str]:
    """One line, `name: old -> new`, for each value in which two parameter tables differ."""
    lines = []
    for key in sorted({*old, *new}):
        before, after = old.get(key), new.get(key)
        if isinstance(before, Mapping) and isinstance(after, Mapping):
            lines += differences(before, after, f"{prefix}{key}.")
        elif before != after:
            lines.append(f"{prefix}{key}: {json.dumps(before)} -> {json.dumps(after)}")
    return lines


def refuse_differences(old: Mapping[str, Any], new: Mapping[str, Any], where: object) -> None:
    """PriorError that names what differs, if anything does."""
    lines = differences(old, new)
    if lines:
        raise PriorError(
            "The prior there was built with other parameters",
            where=where,
            found="; ".join(lines),
            fix="use the same parameters, choose another folder with -o, or rebuild all of it "
            "with --overwrite",
        )
