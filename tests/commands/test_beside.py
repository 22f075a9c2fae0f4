"""What is written beside results is written again unless it is there as it is asked for."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest

from brrp_cli.commands.beside import PLAN, Beside
from brrp_cli.planning.options import PlanOptions

ASKED = {"collision": "hull", "confidence": None, "seed": 0}


@pytest.mark.parametrize(
    ("text", "there"),
    [
        (json.dumps(ASKED), True),
        (json.dumps({**ASKED, "seed": 1}), False),
        ("[]", False),
        ("null", False),
        ("{", False),
        (None, False),
    ],
)
def test_a_plan_that_is_not_as_asked_or_damaged_is_lacking(tmp_path, text, there):
    path = tmp_path / PLAN
    path.parent.mkdir()
    if text is not None:
        path.write_text(text)
    stored = SimpleNamespace(folder=tmp_path, record={"objects": [{"mesh": "object_1.ply"}]})
    asked = Beside(False, [], PlanOptions("hull"), None, False, False, 0)
    assert asked.lacking(stored) == ([] if there else [PLAN])
