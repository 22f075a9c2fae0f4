import math

import pytest

from brrp_cli.evaluation.report_written import written_sections
from brrp_cli.evaluation.rows import variant_columns
from brrp_cli.evaluation.summary import as_record, summarise
from brrp_cli.evaluation.variants import Variant
from brrp_cli.evaluation.written_figures import written_figures
from brrp_cli.ground_truth.surface_metrics import SURFACE_METRICS, no_surface

VPRISM = Variant("vprism")


def row(scene, kind, distance, ratio=1.0, points=(10, 5.0, 5), **values):
    """Points of one bin: how many, the sum of their probabilities, how many are occupied."""
    return {
        "scene": scene,
        "object_id": 1,
        "visible_pixels": 500,
        "status": "ok",
        **variant_columns(VPRISM),
        "thickness_class": kind,
        **dict.fromkeys(SURFACE_METRICS, 1.0),
        "surface_distance": distance,
        "volume_ratio": ratio,
        "nll_occluded": 0.1,
        "diagrams": {region: [[each] for each in points] for region in ("near", "occluded")},
        **values,
    }


ROWS = [
    row("a", "shell", 0.004, ratio=3.0, points=(10, 5.0, 3)),
    row("a", "solid", 0.001),
    row("b", "solid", 0.002, points=(10, 5.0, 7)),
    {k: v for k, v in row("c", "solid", math.nan).items() if k != "diagrams"} | no_surface(),
]


def test_figures_are_those_of_the_groups():
    found = written_figures(ROWS, 0)
    assert list(found) == ["all", "shell", "solid"]
    assert [(g.objects, g.without_mesh) for g in found.values()] == [(4, 1), (1, 0), (3, 1)]
    whole = found["all"].figures
    assert whole["surface_distance"].value == pytest.approx(0.007 / 3)
    assert whole["surface_distance"].count == 3
    assert whole["surface_distance_median"].value == 0.002
    assert whole["volume_ratio_median"].value == 1.0
    # What has no mesh counts as failed, not as missing.
    assert whole["f_score_2mm"].value == 0.75 and whole["f_score_2mm"].count == 4
    assert found["solid"].figures["one_piece"].value == pytest.approx(2 / 3)
    # The shell is 2 points over, one solid 2 points under: together they are right.
    assert whole["ece_occluded"].value == 0.0
    assert found["shell"].figures["ece_occluded"].value == pytest.approx(0.2)
    assert whole["surface_distance"].low <= whole["surface_distance"].high


def test_rows_without_a_known_truth_are_no_failures():
    unknown = {"scene": "d", "status": "failed", "visible_pixels": 20, **variant_columns(VPRISM)}
    assert written_figures([*ROWS, unknown], 0)["all"].objects == 4
    assert written_figures([unknown], 0) == {}


def test_summary_and_report_hold_them():
    (summary,) = summarise(ROWS, [VPRISM], 0)
    record = as_record(summary)["written"]["solid"]
    assert (record["objects"], record["without_mesh"]) == (3, 1)
    assert record["metrics"]["surface_distance"]["value"] == pytest.approx(0.0015)
    heading, first, *_ = written_sections([summary], {VPRISM: "vprism"})
    assert heading == "## The written mesh against the exact mesh"
    lines = first.splitlines()
    assert [line.split(" | ")[1] for line in lines[2:]] == ["all", "shells, under 5 mm", "solid"]
    assert lines[4].split(" | ")[2].startswith("1.50 [") and lines[4].endswith("| 3 | 1 |")


def test_nothing_is_said_of_a_method_without_shapes():
    retrieval = [{k: v for k, v in r.items() if k not in SURFACE_METRICS} for r in ROWS]
    (summary,) = summarise(retrieval, [VPRISM], 0)
    assert written_sections([summary], {VPRISM: "vprism"}) == []
