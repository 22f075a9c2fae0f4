"""What `brrp reconstruct` tells of each object: the outcome, not retrieval's guess; warnings."""

from __future__ import annotations

from dataclasses import replace

import click
import numpy as np
import pytest
import trimesh
from table_scene import TABLE, in_camera, photograph, placed

from brrp_cli.commands.many_frames import one_line
from brrp_cli.commands.object_table import lines, told
from brrp_cli.reconstruction import (
    LOGIT_VARIANCE,
    METRES,
    OK,
    TOO_FEW_POINTS,
    ObjectReconstruction,
    Reconstruction,
    Retrieved,
    Surface,
)
from brrp_cli.shapes import solids


def surface(mesh: trimesh.Trimesh, unit: str = METRES) -> Surface:
    spread = np.full(len(mesh.vertices), 0.0015, np.float32)
    return Surface(np.array(mesh.vertices), np.array(mesh.faces), spread, unit)


def box(size: float = 0.1, z: float = 0.0) -> trimesh.Trimesh:
    return in_camera(solids.moved(solids.box(size, size, size), z=z), placed(0, 0, 0.3))


def tell(item: ObjectReconstruction, *, plane=TABLE, seen=None):
    frame = photograph({1: box()}) if seen is None else seen
    result = Reconstruction(frame, [item], plane, "brrp", "x", None, None, {}, 0, "cpu")
    return told(result)[0]


def item(mesh=None, *, weights=(0.97, 0.0), none=0.03, score=0.9, unit=METRES):
    retrieved = [
        Retrieved("drill", 0.9, alignment_score=0.3, weight=weights[1]),
        Retrieved("can", 0.1, size_factor=1.04, alignment_score=score, weight=weights[0]),
    ]
    return ObjectReconstruction(
        1, OK, retrieved=retrieved, unknown_weight=none, surface=surface(mesh or box(), unit)
    )


def test_the_outcome_is_told_and_not_what_retrieval_held_probable():
    each = tell(item())
    assert (each.taken_for, each.how, each.weight) == ("can", "recognised", 0.97)
    assert each.size_factor == 1.04 and each.uncertainty == pytest.approx(0.0015)
    assert each.warnings == () and not each.failed
    row = click.unstyle(lines([each])[1]).split()
    assert row == ["1", "can", "0.97", "1.04", "1.5", "0.0"]
    unknown = tell(item(weights=(0.0, 0.0), none=1.0))
    assert (unknown.taken_for, unknown.how, unknown.weight) == (None, "not in the prior", 1.0)
    assert "not in the prior" in lines([unknown])[1]
    kin = replace(unknown, taken_for="bowl", how="similar")
    assert kin.name == "like bowl" and "like bowl" in lines([kin])[1]
    assert "1 of 1 object, 2.0 s: like bowl" in one_line("scene", [kin], 2.0)
    assert tell(item(unit=LOGIT_VARIANCE)).uncertainty is None


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (item(score=0.6), "low alignment score 0.60"),
        (item(weights=(0.4, 0.3), none=0.3), "no object has half of the weight"),
        (item(trimesh.util.concatenate([box(), box(0.03, z=0.12)])), "mesh in 2 pieces"),
        (item(box(1.0)), "suspect the unit of depth"),
        (item(box(0.005)), "suspect the unit of depth"),
        (item(box(z=0.06)), "6 cm above the table"),
        (item(box(z=-0.15)), "5 cm below the table"),
    ],
)
def test_a_warning_is_told_where_it_is_due(made, says):
    assert any(says in warning for warning in tell(made).warnings), tell(made).warnings


def test_a_mask_at_the_border_is_told_and_no_table_is_no_fault():
    seen = photograph({1: box()})
    segmap = seen.segmap.copy()
    segmap[100:110, -1] = 1
    seen = replace(seen, segmap=segmap)
    assert tell(item(), seen=seen).warnings == ("mask at the image's border",)
    assert tell(item(box(z=0.06)), plane=None).warnings == ()


def test_columns_stand_one_below_the_other_and_failures_are_told():
    failed = ObjectReconstruction(12, TOO_FEW_POINTS, "4 valid depth points")
    rows = [click.unstyle(line) for line in lines([tell(item()), tell(failed)])]
    at = rows[0].index("weight") + len("weight")
    assert rows[1][:at].endswith("0.97") and rows[2][:at].endswith("-")
    assert "too_few_points; 4 valid depth points" in rows[2]
    assert tell(failed).failed
