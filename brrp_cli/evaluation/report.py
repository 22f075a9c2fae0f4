"""report.md: the written meshes, then probabilities, retrieval, and the published protocol."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from brrp_cli.evaluation import published
from brrp_cli.evaluation.bootstrap import Interval
from brrp_cli.evaluation.markdown import Column, figure, table
from brrp_cli.evaluation.report_written import WRITTEN_NOTES, written_sections
from brrp_cli.evaluation.rows import STAGES
from brrp_cli.evaluation.summary import VariantSummary
from brrp_cli.evaluation.variants import Variant
from brrp_cli.spoken import counted

Labels = Mapping[Variant, str]
Differences = Mapping[tuple[Variant, Variant], Mapping[str, Interval]]

WRITTEN_DIFFERENCES: list[Column] = [
    ("distance, mm", "surface_distance", 1000, 2),
    ("F 2 mm", "f_score_2mm", 1, 3),
    ("F 5 mm", "f_score_5mm", 1, 3),
]
PUBLISHED_WAY: list[Column] = [("IoU", "iou", 1, 3), ("Chamfer, cm", "chamfer", 100, 2)]
EXACT: list[Column] = [
    ("IoU", "iou_exact", 1, 3),
    ("Chamfer, cm", "chamfer_exact", 100, 2),
    ("IoU at 5 mm", "iou_5mm", 1, 3),
    ("F-score at 1 cm", "f_score_1cm", 1, 3),
]
PROBABILITIES: list[Column] = [
    ("Brier", "brier_{}", 1, 4),
    ("NLL, nats", "nll_{}", 1, 3),
    ("ECE", "ece_{}", 1, 4),
    ("AUSE", "ause_{}", 1, 3),
    ("AUSE, by entropy", "ause_entropy_{}", 1, 3),
]
RECOGNISED: list[Column] = [
    ("recognised, of 1,000 px or more", "recognised_clear", 1, 3),
    ("weight of the true object", "weight_true_clear", 1, 3),
    ("recognised at another size", "other_size", 1, 3),
    ("placed model to true surface, mm, of recognised", "placement_recognised", 1000, 2),
    ("its points to their true places, mm", "pose_recognised", 1000, 2),
    ("by less than a tenth of its diameter", "pose_right", 1, 3),
    ("or of one that is told as alike", "pose_told", 1, 3),
    ("strangers taken for a stored object", "stranger_taken", 1, 3),
]
PLACEMENT: list[Column] = [
    ("true object first", "true_first", 1, 2),
    ("among the first 3", "true_in_3", 1, 2),
    ("among the first 10", "true_in_10", 1, 2),
    ("P(true object)", "true_probability", 1, 2),
    ("ECE of P(c\\|R)", "ece_retrieval", 1, 3),
    ("P(not in prior), of those in it", "absent_inside", 1, 2),
    ("of those not in it", "absent_outside", 1, 2),
    ("placed model to true surface, mm", "placement_error", 1000, 2),
]

NOTES = """\
How to read it:

{written}- Objects with at least 16 visible pixels in the first view of each scene. An object whose
  posterior holds nothing (**empty**) has IoU 0 and F-score 0 on the grids and no Chamfer distance;
  one without any posterior (**failed**) has none of the metrics on grids. Both are counted beside
  the means.
- In brackets: 95 % bootstrap interval over scenes (whole scenes are drawn again, {rounds} times).
- Recognised: more weight on the true object than on any other stored object and than on "none of
  them". At another size: the placed model is more than 2 % larger or smaller than the true one. A
  stranger, which the prior does not hold, is taken for a stored object where that has a weight
  over 0.5. Points of the placed mesh are compared with their true places (ADD) where the stored
  mesh is the true one; a ball or a can that looks alike when it is turned counts like the others.
- Published protocol: true mesh closed by point-cloud-utils at resolution 4,000 (IoU) and 10,000
  (Chamfer), which thickens thin walls; 1.5 cm grid over ±0.2 m around the middle of the true
  bounding box, along the world's axes; Chamfer is the sum of both mean distances between 8,000
  points of either surface. Exact: the same against the true mesh that is repaired but not
  thickened; IoU at 5 mm and F-score at 1 cm on a 5 mm grid, against that mesh too.
- Probabilities are judged on a 1 cm grid in the true bounding box grown by 5 cm; occluded points
  lie behind the depth that was measured along their ray, those inside and below the table
  included. ECE: 15 bins, over the points of all objects. AUSE (0: perfect) ranks points by the
  method's own uncertainty, or by the entropy of the probability; the error is the squared
  difference of probability and truth.
- Seconds are wall time on one thread for each object's share; memory is the process's peak.
"""


def write_report(
    record: Mapping[str, Any],
    summaries: Sequence[VariantSummary],
    found: Differences,
    labels: Labels,
    plots: Sequence[Path],
) -> str:
    """The text of report.md. `record`: what run.json and summary.json say of the run."""
    parts = [
        f"# Evaluation of {counted(record['scenes_total'], 'scene')}",
        _facts(record),
        *written_sections(summaries, labels),
    ]
    for region, title in (("occluded", "occluded points"), ("near", "all points near the objects")):
        columns = [(head, name.format(region), f, d) for head, name, f, d in PROBABILITIES]
        parts += [f"## Probabilities, {title}", _figures_table(summaries, labels, columns)]
    with_prior = [s for s in summaries if s.variant.retriever is not None]
    if with_prior:
        parts += ["## Recognition", _figures_table(with_prior, labels, RECOGNISED)]
        parts += ["## Retrieval", _figures_table(with_prior, labels, PLACEMENT)]
        parts += ["Objects of the prior, by visible pixels:", _hits_table(with_prior, labels)]
    parts += [
        "## The published protocol, for comparison with the paper",
        _figures_table(summaries, labels, PUBLISHED_WAY),
        _same(record),
        "The paper's table, on its own scenes (other objects, other renderings: orders of "
        "magnitude may be compared, not decimals):",
        _paper_table(),
        "The same grid against the exact mesh, and a finer one:",
        _figures_table(summaries, labels, EXACT),
    ]
    if found:
        parts += ["## What knowledge of objects adds", _difference_table(found, labels)]
    parts += ["## Time and memory", _cost_table(summaries, labels), "## Plots"]
    parts += [f"![{path.stem}]({path.parent.name}/{path.name})" for path in plots]
    parts += ["## Notes", NOTES.format(rounds=record["bootstrap_rounds"], written=WRITTEN_NOTES)]
    return "\n\n".join(part.rstrip() for part in parts if part) + "\n"


def _figures_table(
    summaries: Sequence[VariantSummary], labels: Labels, columns: Sequence[Column]
) -> str:
    rows = [
        [
            labels[s.variant],
            *(figure(s.figures[name], factor, digits) for _, name, factor, digits in columns),
            str(s.objects),
            str(s.failed),
            str(s.empty),
        ]
        for s in summaries
    ]
    headings = ["", *(heading for heading, *_ in columns), "objects", "failed", "empty"]
    return table(headings, rows)


def _hits_table(summaries: Sequence[VariantSummary], labels: Labels) -> str:
    rows = [
        [
            labels[s.variant],
            f"over {h.above:g}" + ("" if math.isinf(h.most) else f" to {h.most:g}"),
            *(f"{share:.3f}" for share in (h.first, h.in_3, h.in_10)),
            str(h.count),
        ]
        for s in summaries
        for h in s.hits
        if h.count
    ]
    return table(["", "visible pixels", "first", "among 3", "among 10", "objects"], rows)


def _paper_table() -> str:
    rows = [
        [name, *("–" if value is None else f"{value:g}" for value in values)]
        for name, values in published.TABLE.items()
    ]
    return table(published.COLUMNS, rows)


def _difference_table(found: Differences, labels: Labels) -> str:
    columns = [*WRITTEN_DIFFERENCES, *PUBLISHED_WAY, *EXACT]
    first = len(columns) - len(EXACT)
    headings = [
        "",
        *(f"{head}{' (exact)' * (c >= first)}" for c, (head, *_) in enumerate(columns)),
        "pairs",
    ]
    rows = [
        [
            f"{labels[variant]} − {labels[baseline]}",
            *(figure(metrics[name], factor, digits) for _, name, factor, digits in columns),
            str(metrics["iou"].count),
        ]
        for (variant, baseline), metrics in found.items()
    ]
    return table(headings, rows)


def _cost_table(summaries: Sequence[VariantSummary], labels: Labels) -> str:
    show: Callable[[float], str] = lambda s: "–" if math.isnan(s) else f"{s:.2f}"  # noqa: E731
    rows = [
        [
            labels[s.variant],
            *(show(s.seconds[stage]) for stage in (*STAGES, "total")),
            f"{s.peak_memory_mb:.0f}",
        ]
        for s in summaries
    ]
    headings = ["seconds an object", *STAGES, "total", "peak memory, MB"]
    return table(headings, rows)


def _facts(record: Mapping[str, Any]) -> str:
    lines = [
        f"- scenes: `{record['scenes']}`, {record['scenes_total']} of them",
        f"- prior: `{record['prior']['path']}`, digest {record['prior']['digest'][:12]}"
        if record["prior"]
        else "- prior: none",
        *(trained_line(name, found) for name, found in record["trained"].items()),
        f"- seed {record['seed']}; depth {'with sensor noise' if record['noise'] else 'as it is'}",
        f"- command: `{record['command']}`",
        f"- machine: {record['machine']}",
    ]
    lines += [f"- lost: scene {name}: {why}" for name, why in record["lost"].items()]
    return "\n".join(lines)


def trained_line(name: str, training: Mapping[str, Any]) -> str:
    """What stands in the report of weights: on what, and how long."""
    epochs = training.get("config", {}).get("epochs")
    loss = training.get("validation_loss", math.nan)
    return (
        f"- weights `{name}`: trained on {training.get('objects')} views of objects in "
        f"{training.get('scenes')} scenes of {len(training.get('meshes', []))} meshes, "
        f"epoch {training.get('epoch')} of {epochs}; labels of the {training.get('truth')} mesh; "
        f"validation loss {loss:.4f}"
    )


def _same(record: Mapping[str, Any]) -> str:
    return "\n".join(
        f"{one} and {other} have one configuration: they were run once, and the same rows stand "
        "under both names."
        for one, other in record["same"].items()
    )
