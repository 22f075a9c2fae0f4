"""Plots of an evaluation, as PNG."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from brrp_cli.evaluation.bootstrap import Interval
from brrp_cli.evaluation.rows import STAGES
from brrp_cli.evaluation.score_object import REGIONS
from brrp_cli.evaluation.summary import VariantSummary
from brrp_cli.evaluation.variants import Variant
from brrp_cli.files import atomic_path

Labels = dict[Variant, str]


def write_plots(folder: Path, summaries: Sequence[VariantSummary], labels: Labels) -> list[Path]:
    """Every plot that these variants allow; returns the files.

    distance.png, chamfer.png, reliability.png, timing.png; iou_k.png where k varies; iou_shift.png
    where shifted and unshifted masks are both there.
    """
    figures = {
        "distance": distance_bars(summaries, labels),
        "chamfer": chamfer_bars(summaries, labels),
        "iou_k": iou_against_k(summaries),
        "iou_shift": shifted_bars(summaries),
        "timing": timing_bars(summaries, labels),
        "reliability": reliability_diagram(summaries, labels),
    }
    written = []
    for name, figure in figures.items():
        if figure is not None:
            with atomic_path(folder / f"{name}.png") as partial:
                figure.savefig(partial, dpi=110, metadata={"Software": None})
            written.append(folder / f"{name}.png")
    return written


def distance_bars(summaries: Sequence[VariantSummary], labels: Labels) -> Any:
    """Mean distance of each variant's written meshes and the exact ones, mm, with intervals."""
    figure, (axes,) = _figure(1, width=2 + 1.2 * len(summaries))
    bars = [(labels[s.variant], s.figures["surface_distance"]) for s in summaries]
    _bars(axes, bars, factor=1000)
    axes.set_ylabel("surface distance, mm (lower is better)")
    return figure


def chamfer_bars(summaries: Sequence[VariantSummary], labels: Labels) -> Any:
    """Mean Chamfer distance of each variant, cm, with intervals."""
    figure, (axes,) = _figure(1, width=2 + 1.2 * len(summaries))
    _bars(axes, [(labels[s.variant], s.figures["chamfer"]) for s in summaries], factor=100)
    axes.set_ylabel("Chamfer distance, cm (lower is better)")
    return figure


def iou_against_k(summaries: Sequence[VariantSummary]) -> Any | None:
    """IoU over the number of retrieved objects, a line for each variant that differs otherwise."""
    lines: dict[Variant, list[VariantSummary]] = {}
    for summary in summaries:
        v = summary.variant
        if v.k is not None:
            key = Variant(v.method, v.preset, None, v.retriever, shift=v.shift)
            lines.setdefault(key, []).append(summary)
    lines = {key: found for key, found in lines.items() if len(found) > 1}
    if not lines:
        return None
    figure, (axes,) = _figure(1)
    for key, found in lines.items():
        found.sort(key=lambda s: s.variant.k or 0)
        ks = [s.variant.k for s in found]
        intervals = [s.figures["iou"] for s in found]
        name = f"{key.method} {key.preset} {key.retriever}" + (f" {key.shift} px" * bool(key.shift))
        axes.errorbar(ks, [i.value for i in intervals], _errors(intervals), capsize=3, label=name)
        axes.set_xticks(sorted({*axes.get_xticks(), *ks} & set(ks)))
    axes.set_xlabel("retrieved objects k")
    axes.set_ylabel("IoU")
    axes.legend()
    return figure


def shifted_bars(summaries: Sequence[VariantSummary]) -> Any | None:
    """IoU with masks where they belong and beside, for each variant that was run with both."""
    groups: dict[Variant, dict[int, Interval]] = {}
    for summary in summaries:
        v = summary.variant
        key = Variant(v.method, v.preset, v.k, v.retriever, weights=v.weights)
        groups.setdefault(key, {})[v.shift] = summary.figures["iou"]
    groups = {key: found for key, found in groups.items() if len(found) > 1}
    if not groups:
        return None
    shifts = sorted({shift for found in groups.values() for shift in found})
    figure, (axes,) = _figure(1, width=2 + 1.5 * len(groups))
    width = 0.8 / len(shifts)
    for n, shift in enumerate(shifts):
        intervals = [found.get(shift, Interval(math.nan)) for found in groups.values()]
        places = np.arange(len(groups)) + (n - (len(shifts) - 1) / 2) * width
        axes.bar(
            places,
            [i.value for i in intervals],
            width,
            yerr=_errors(intervals),
            capsize=3,
            label=f"masks shifted by {shift} px" if shift else "masks as they are",
        )
    axes.set_xticks(range(len(groups)), [_wrapped(key.label) for key in groups])
    axes.set_ylabel("IoU")
    axes.legend()
    return figure


def timing_bars(summaries: Sequence[VariantSummary], labels: Labels) -> Any:
    """Mean seconds an object, stage on stage."""
    figure, (axes,) = _figure(1, width=2 + 1.2 * len(summaries))
    base = np.zeros(len(summaries))
    for stage in STAGES:
        heights = np.nan_to_num([s.seconds[stage] for s in summaries])
        if heights.any():
            axes.bar(range(len(summaries)), heights, 0.6, bottom=base, label=stage)
            base = base + heights
    axes.set_xticks(range(len(summaries)), [_wrapped(labels[s.variant]) for s in summaries])
    axes.set_ylabel("seconds an object, one thread")
    axes.legend()
    return figure


def reliability_diagram(summaries: Sequence[VariantSummary], labels: Labels) -> Any:
    """How often points are occupied, over the probability that says so: all points near the
    objects, and the occluded ones alone."""
    figure, panels = _figure(len(REGIONS), width=10)
    titles = {"near": "all points near the objects", "occluded": "occluded points alone"}
    for axes, region in zip(panels, REGIONS, strict=True):
        axes.plot([0, 1], [0, 1], color="0.7", linewidth=1)
        for summary in summaries:
            count, probability, occupied = summary.diagrams[region]
            filled = count > 0
            error = summary.figures[f"ece_{region}"].value
            axes.plot(
                probability[filled] / count[filled],
                occupied[filled] / count[filled],
                marker="o",
                markersize=3,
                label=f"{labels[summary.variant]} (ECE {error:.3f})",
            )
        axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", title=titles[region])
        axes.set_xlabel("occupancy probability")
        axes.set_ylabel("share of points that are occupied")
        axes.legend(fontsize=7)
    return figure


def _figure(panels: int, width: float = 6.0) -> tuple[Any, list[Any]]:
    """A figure that needs no screen and no global state."""
    # On first use it tells how it builds a cache of fonts.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(width, 4.5), 4.5), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, [figure.add_subplot(1, panels, n + 1) for n in range(panels)]


def _bars(axes: Any, entries: Sequence[tuple[str, Interval]], factor: float) -> None:
    intervals = [interval for _, interval in entries]
    places = range(len(entries))
    axes.bar(
        places,
        [i.value * factor for i in intervals],
        0.6,
        yerr=_errors(intervals, factor),
        capsize=3,
    )
    axes.set_xticks(places, [_wrapped(label) for label, _ in entries])


def _errors(intervals: Sequence[Interval], factor: float = 1.0) -> Any:
    """Lengths (2, n) of error bars, 0 where there is no interval."""
    below = [(i.value - i.low) * factor for i in intervals]
    above = [(i.high - i.value) * factor for i in intervals]
    return np.maximum(np.nan_to_num([below, above]), 0.0)


def _wrapped(label: str) -> str:
    return label.replace(" ", "\n")
