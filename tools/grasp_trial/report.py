"""Tables of carried out grasps: shares that held, how the others failed, what a score is worth."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from brrp_cli.evaluation.bootstrap import Interval, cluster_bootstrap, mean_interval
from grasp_trial.trial import HELD, OUTCOMES

BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.97, 1.0001)
Row = dict[str, Any]


def report(rows: Sequence[Row], drift: float) -> str:
    """Markdown. Objects that move by more than `drift` metres without any hand are left out: they
    do not stand as the scene has them, which was settled with their convex hulls."""
    rows = [row for row in rows if row["drift"] is None or row["drift"] <= drift]
    rng = np.random.default_rng(0)
    sets = list(dict.fromkeys(row["set"] for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    return "\n\n".join(
        [
            _success(rows, sets, methods, rng),
            _failures(rows, methods, rng),
            _against(rows, sets, methods, rng),
            _reliability([r for r in rows if r["method"] == "default"], rng),
            _difference(rows, rng),
        ]
    )


def _chosen(rows: Sequence[Row], **which: str) -> list[Row]:
    """Rows of the grasps that a method ranks first, and of objects for which it plans none; not of
    those that are drawn."""
    return [
        row
        for row in rows
        if row["rank"] != "drawn" and all(row[key] == value for key, value in which.items())
    ]


def _tried(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["result"] != "none"]


def _first(rows: Sequence[Row]) -> list[Row]:
    """One row for each object, of its best grasp or of none."""
    return [row for row in rows if row["rank"] == 1]


def _held(rows: Sequence[Row], rng: np.random.Generator) -> Interval:
    held = [float(row["result"] == HELD) for row in rows]
    return mean_interval(held, [row["scene"] for row in rows], rng)


def _told(found: Interval) -> str:
    if found.count == 0:
        return "-"
    return f"{found.value:.0%}{_between(found.low, found.high)}, {found.count}"


def _between(low: float, high: float, sign: str = "") -> str:
    """Such as " (20% to 40%)"; nothing where one scene gives no interval."""
    return "" if np.isnan(low) else f" ({low:{sign}.0%} to {high:{sign}.0%})"


def _success(
    rows: Sequence[Row], sets: list[str], methods: list[str], rng: np.random.Generator
) -> str:
    lines = [
        "| method | set | held (95 %), grasps | first of each object | held by their first,"
        " of all objects |",
        "| --- | --- | --- | --- | --- |",
    ]
    for method in methods:
        for name in sets:
            mine = _chosen(rows, method=method, set=name)
            shares = [_tried(mine), _tried(_first(mine)), _first(mine)]
            cells = " | ".join(_told(_held(each, rng)) for each in shares)
            lines.append(f"| {method} | {name} | {cells} |")
    return "\n".join(lines)


def _failures(rows: Sequence[Row], methods: list[str], rng: np.random.Generator) -> str:
    """How the grasps that were ranked first ended: counts, and shares over scenes."""
    lines = [
        "| method | grasps | " + " | ".join(OUTCOMES) + " |",
        "| --- | --- |" + " --- |" * len(OUTCOMES),
    ]
    for method in methods:
        tried = _tried(_chosen(rows, method=method))
        scenes = [row["scene"] for row in tried]
        cells = []
        for outcome in OUTCOMES:
            found = mean_interval([float(row["result"] == outcome) for row in tried], scenes, rng)
            count = sum(row["result"] == outcome for row in tried)
            cells.append(f"{count}{_between(found.low, found.high)}" if count else "0")
        lines.append(f"| {method} | {len(tried)} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _against(
    rows: Sequence[Row], sets: list[str], methods: list[str], rng: np.random.Generator
) -> str:
    """By how much a larger share of the grasps of `default` held than of another method's, and of
    all objects by their first grasp, drawn by scene."""
    lines = [
        "| default against | set | more grasps held (95 %) | more of all objects |",
        "| --- | --- | --- | --- |",
    ]
    for method in methods:
        for name in sets if method != "default" else []:
            both = [_chosen(rows, method=m, set=name) for m in ("default", method)]
            # Scenes that both have tried: a method may be stopped before another.
            shared = set.intersection(*({row["scene"] for row in mine} for mine in both))
            both = [[row for row in mine if row["scene"] in shared] for mine in both]
            if all(both):
                more = _more([_tried(mine) for mine in both], rng)
                objects = _more([_first(mine) for mine in both], rng)
                lines.append(f"| {method} | {name} | {more} | {objects} |")
    return "\n".join(lines)


def _more(both: list[list[Row]], rng: np.random.Generator) -> str:
    scenes = sorted({row["scene"] for mine in both for row in mine})
    if not all(both):
        return "-"
    sums = np.zeros((len(scenes), 4))
    for i, mine in enumerate(both):
        for row in mine:
            sums[scenes.index(row["scene"]), 2 * i : 2 * i + 2] += [row["result"] == HELD, 1]
    value, low, high = cluster_bootstrap(sums, _gap, rng)
    return f"{value:+.0%}{_between(low, high, '+')}"


def _gap(totals: np.ndarray) -> np.ndarray:
    """Of totals (r, 4), held and tried of two methods: (r,)."""
    with np.errstate(invalid="ignore"):
        return np.asarray(totals[:, 0] / totals[:, 1] - totals[:, 2] / totals[:, 3])


def _reliability(rows: Sequence[Row], rng: np.random.Generator) -> str:
    """How often grasps of `default` held, by score, all that were carried out."""
    tried = _tried(rows)
    score = np.array([row["score"] for row in tried])
    held = np.array([row["result"] == HELD for row in tried], dtype=float)
    scenes = np.array([row["scene"] for row in tried])
    lines = ["| score | grasps | mean score | held |", "| --- | --- | --- | --- |"]
    which = np.digitize(score, BINS) - 1
    for i, (low, high) in enumerate(pairwise(BINS)):
        mine = which == i
        if mine.any():
            share = mean_interval(held[mine], scenes[mine].tolist(), rng)
            lines.append(
                f"| {low:g} to {min(high, 1):g} | {mine.sum()} | {score[mine].mean():.2f} |"
                f" {share.value:.0%}{_between(share.low, share.high)} |"
            )
    if len(tried):
        gap = [abs(held[which == i].sum() - score[which == i].sum()) for i in np.unique(which)]
        lines.append(f"\nExpected calibration error: {sum(gap) / len(tried):.2f}.")
    return "\n".join(lines)


def _difference(rows: Sequence[Row], rng: np.random.Generator) -> str:
    """By how much ranking by the posterior's score beats ranking by the mean mesh: means over an
    object's grasps, object by object; one that a method plans no grasp of counts as neither."""
    names = ("default", "mean mesh")
    found: dict[tuple[str, int], dict[str, list[float]]] = {}
    for row in _tried(_chosen(rows)):
        if row["method"] in names:
            of = found.setdefault((row["scene"], row["object"]), {})
            of.setdefault(row["method"], []).append(float(row["result"] == HELD))
    both = {key: of for key, of in found.items() if len(of) == 2}
    if not both:
        return ""
    scenes = sorted({scene for scene, _ in both})
    sums = np.zeros((len(scenes), 2))
    for (scene, _), of in both.items():
        won = [float(np.mean(of[name])) for name in names]
        sums[scenes.index(scene)] += [won[0] - won[1], 1]
    value, low, high = cluster_bootstrap(sums, lambda t: t[:, 0] / t[:, 1], rng)
    return (
        f"Ranking by the posterior's score against the mean mesh, {len(both)} objects of which "
        f"both plan a grasp: {value:+.0%}{_between(low, high, '+')}."
    )
