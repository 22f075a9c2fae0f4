"""From rows to the figures of a report: means, intervals, and what has no value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.evaluation.bootstrap import Interval, calibration_interval, mean_interval
from brrp_cli.evaluation.recognition import RECOGNITION_FIGURES, with_recognition
from brrp_cli.evaluation.retrieval import (
    Hits,
    hits_by_pixels,
    retrieval_calibration,
    with_places,
)
from brrp_cli.evaluation.rows import METRICS, STAGES, Row, variant_columns, variant_of
from brrp_cli.evaluation.score_object import REGIONS
from brrp_cli.evaluation.variants import Variant
from brrp_cli.evaluation.written_figures import WrittenFigures, written_figures, written_record
from brrp_cli.methods.registry import METHODS
from brrp_cli.reconstruction import FAILED, TOO_FEW_POINTS
from brrp_cli.seeds import child_rng

RETRIEVAL = (
    "true_first",
    "true_in_3",
    "true_in_10",
    "true_probability",
    "absent_inside",
    "absent_outside",
    "placement_error",
)


@dataclass(frozen=True)
class VariantSummary:
    """One variant over a set.

    Attributes
    ----------
    objects : rows; failed : those without any reconstruction, which have no metric; empty : those
        whose reconstruction holds nothing, which have IoU 0 and no Chamfer distance
    figures : metric -> mean and interval, the set's expected calibration errors included
    seconds : stage -> mean over objects; peak_memory_mb : largest
    diagrams : region -> reliability sums (3, bins) of the set
    hits : how often retrieval finds the true object, by visible pixels
    written : figures of the written meshes, of all objects and by thickness class
    """

    variant: Variant
    objects: int
    failed: int
    empty: int
    figures: dict[str, Interval]
    seconds: dict[str, float]
    peak_memory_mb: float
    diagrams: dict[str, NDArray[np.float64]]
    hits: list[Hits] = field(default_factory=list)
    written: dict[str, WrittenFigures] = field(default_factory=dict)


def summarise(rows: Sequence[Row], variants: Sequence[Variant], seed: int) -> list[VariantSummary]:
    """The summary of each variant, in their order. The same rows and seed give the same numbers."""
    return [
        _one(variant, [r for r in rows if variant_of(r) == variant], seed) for variant in variants
    ]


def _one(variant: Variant, rows: list[Row], seed: int) -> VariantSummary:
    scored = [row for row in rows if "diagrams" in row]
    figures = {name: _mean(rows, name, seed) for name in METRICS}
    diagrams = {}
    for region in REGIONS:
        found = [np.asarray(row["diagrams"][region], dtype=np.float64) for row in scored]
        rng = child_rng(seed, "bootstrap", f"ece_{region}")
        figures[f"ece_{region}"] = calibration_interval(found, [r["scene"] for r in scored], rng)
        diagrams[region] = np.sum(found, axis=0) if found else np.zeros((3, 0))
    known = [with_recognition(with_places(row)) for row in rows]
    figures |= {name: _mean(known, name, seed) for name in (*RETRIEVAL, *RECOGNITION_FIGURES)}
    figures["ece_retrieval"] = retrieval_calibration(rows)
    return VariantSummary(
        variant=variant,
        objects=len(rows),
        failed=sum(row["status"] in (FAILED, TOO_FEW_POINTS) for row in rows),
        empty=sum(math.isnan(row.get("chamfer", math.nan)) for row in scored),
        figures=figures,
        seconds={stage: _average(rows, f"seconds_{stage}") for stage in (*STAGES, "total")},
        peak_memory_mb=max((row.get("peak_memory_mb") or 0.0 for row in rows), default=math.nan),
        diagrams=diagrams,
        hits=hits_by_pixels(rows),
        written=written_figures(rows, seed),
    )


def differences(
    rows: Sequence[Row], variants: Sequence[Variant], seed: int, metrics: Sequence[str]
) -> dict[tuple[Variant, Variant], dict[str, Interval]]:
    """Mean difference, a variant less a baseline, over the objects that have a value in both.

    A baseline knows less of objects: one without a prior against one with it, one that was not
    trained against one that was. The masks of a pair are shifted alike.
    """
    values = {(variant_of(row), row["scene"], row["object_id"]): row for row in rows}
    result = {}
    for variant in variants:
        for baseline in variants:
            if _knowledge(variant) <= _knowledge(baseline):
                continue
            if variant.shift != baseline.shift:
                continue
            pairs = [
                (row["scene"], values[variant, scene, i], row)
                for (v, scene, i), row in values.items()
                if v == baseline and (variant, scene, i) in values
            ]
            result[variant, baseline] = {
                name: mean_interval(
                    [a.get(name, math.nan) - b.get(name, math.nan) for _, a, b in pairs],
                    [scene for scene, _, _ in pairs],
                    child_rng(seed, "bootstrap", name),
                )
                for name in metrics
            }
    return result


def _knowledge(variant: Variant) -> int:
    """2 with a prior, 1 after training, 0 with neither."""
    return 2 if METHODS[variant.method].uses_prior else int(variant.weights is not None)


def as_record(summary: VariantSummary) -> dict[str, Any]:
    """Plain JSON: NaN is null, lengths in metres."""
    return {
        "variant": variant_columns(summary.variant),
        "objects": summary.objects,
        "failed": summary.failed,
        "empty": summary.empty,
        "written": written_record(summary.written, interval_record),
        "metrics": {name: interval_record(i) for name, i in summary.figures.items()},
        "hits": [{k: _json(v) for k, v in _finite(asdict(h)).items()} for h in summary.hits],
        "seconds": {stage: _json(round(s, 4)) for stage, s in summary.seconds.items()},
        "peak_memory_mb": _json(summary.peak_memory_mb),
        "reliability": {
            region: dict(zip(("points", "probability", "occupied"), sums.tolist(), strict=True))
            for region, sums in summary.diagrams.items()
        },
    }


def interval_record(interval: Interval) -> dict[str, Any]:
    """Plain JSON of a figure."""
    return {name: _json(value) for name, value in asdict(interval).items()}


def _mean(rows: Sequence[Row], name: str, seed: int) -> Interval:
    values = [row.get(name, math.nan) for row in rows]
    rng = child_rng(seed, "bootstrap", name)
    return mean_interval(values, [row["scene"] for row in rows], rng)


def _average(rows: Sequence[Row], name: str) -> float:
    values = [row[name] for row in rows if not math.isnan(row.get(name, math.nan))]
    return float(np.mean(values)) if values else math.nan


def _finite(record: dict[str, Any]) -> dict[str, Any]:
    """JSON has no infinity."""
    return {k: None if v == math.inf else v for k, v in record.items()}


def _json(value: float) -> float | None:
    return None if isinstance(value, float) and math.isnan(value) else value
