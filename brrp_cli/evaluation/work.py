"""What an evaluation is to do, as its workers are told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from brrp_cli.evaluation.rows import OBJECT, Row, variant_columns
from brrp_cli.evaluation.variants import Variant
from brrp_cli.ground_truth.scenes import Scene
from brrp_cli.reconstruction import FAILED


@dataclass(frozen=True)
class Plan:
    """Everything that a worker has to know.

    weights : files by name, of those that are given; a method finds its own by itself
    """

    scenes: list[Scene]
    variants: list[Variant]
    data_root: Path
    cache: Path
    prior: Path | None = None
    clip_dir: Path | None = None
    noise: bool = False
    view: int = 0
    seed: int = 0
    device: str = "cpu"
    pictures: Path | None = None
    weights: Mapping[str, Path] = field(default_factory=dict)


def lost_row(scene: str, view: int, variant: Variant, message: str) -> Row:
    """What stands for a view of which nothing is known."""
    found = dict.fromkeys(OBJECT) | {"scene": scene, "view": view, "objects_in_view": 1}
    return {**found, **variant_columns(variant), "status": FAILED, "message": message}
