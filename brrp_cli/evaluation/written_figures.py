"""Figures of the written meshes: of all objects, and by how thick they truly are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brrp_cli.evaluation.bootstrap import (
    Interval,
    calibration_interval,
    mean_interval,
    median_interval,
)
from brrp_cli.evaluation.rows import Row
from brrp_cli.ground_truth.surface_metrics import SURFACE_METRICS
from brrp_cli.ground_truth.thickness import THICKNESS_CLASSES
from brrp_cli.seeds import child_rng

ALL = "all"
GROUPS = (ALL, *THICKNESS_CLASSES)
MEDIANS = ("surface_distance", "volume_ratio")
OCCLUDED = "occluded"


@dataclass(frozen=True)
class WrittenFigures:
    """One variant over the objects of a group.

    objects : those whose true mesh is known; without_mesh : those of them that got none
    figures : mean and interval of `SURFACE_METRICS` and of nll_occluded; medians as NAME_median;
    ece_occluded of the group
    """

    objects: int
    without_mesh: int
    figures: dict[str, Interval]


def written_figures(rows: Sequence[Row], seed: int) -> dict[str, WrittenFigures]:
    """The figures of one variant's rows, of all objects first; no entry for an empty group."""
    scored = [row for row in rows if not math.isnan(row.get("watertight", math.nan))]
    found = {}
    for group in GROUPS:
        members = [row for row in scored if group in (ALL, row["thickness_class"])]
        if members:
            found[group] = _figures(members, seed)
    return found


def _figures(rows: list[Row], seed: int) -> WrittenFigures:
    scenes = [row["scene"] for row in rows]

    def values(name: str) -> list[float]:
        return [row.get(name, math.nan) for row in rows]

    names = (*SURFACE_METRICS, f"nll_{OCCLUDED}")
    figures = {
        name: mean_interval(values(name), scenes, child_rng(seed, "bootstrap", name))
        for name in names
    }
    for name in MEDIANS:
        rng = child_rng(seed, "bootstrap", name, "median")
        figures[f"{name}_median"] = median_interval(values(name), scenes, rng)
    judged = [row for row in rows if "diagrams" in row]
    figures[f"ece_{OCCLUDED}"] = calibration_interval(
        [np.asarray(row["diagrams"][OCCLUDED], dtype=np.float64) for row in judged],
        [row["scene"] for row in judged],
        child_rng(seed, "bootstrap", f"ece_{OCCLUDED}"),
    )
    return WrittenFigures(
        len(rows), sum(math.isnan(value) for value in values("surface_distance")), figures
    )


def written_record(found: dict[str, WrittenFigures], as_json: Any) -> dict[str, Any]:
    """Plain JSON; `as_json` turns an Interval into it."""
    return {
        group: {
            "objects": each.objects,
            "without_mesh": each.without_mesh,
            "metrics": {name: as_json(interval) for name, interval in each.figures.items()},
        }
        for group, each in found.items()
    }
