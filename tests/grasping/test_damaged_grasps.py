"""A grasps.json of another making: no hands are drawn of it, and MoveIt's scene refuses it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from for_people import assert_for_people

from brrp_cli.errors import ResultError
from brrp_cli.grasping.drawing import stored_hands
from brrp_cli.grasping.gripper_file import open_gripper
from brrp_cli.grasping.record import RECORD, SCHEMA
from brrp_cli.planning.moveit_grasps import stored_grasps

WHOLE = {
    "schema": SCHEMA,
    "frame": "camera",
    "gripper": vars(open_gripper("franka-hand")),
    "config": {"approach": 0.1},
    "objects": [
        {
            "id": 7,
            "grasps": [{"T_cam_gripper": np.eye(4).tolist(), "score": 0.9, "opening": 0.05}],
        }
    ],
}


def test_a_whole_one_is_read(tmp_path):
    (tmp_path / RECORD).write_text(json.dumps(WHOLE))
    assert list(stored_hands(tmp_path)) == [7]
    assert list(stored_grasps(tmp_path)) == ["object_7"]


@pytest.mark.parametrize(
    ("change", "refused"),
    [
        ({"gripper": []}, False),
        ({"gripper": None}, False),
        ({"objects": [{"id": float("inf"), "grasps": WHOLE["objects"][0]["grasps"]}]}, True),
        ({"objects": [{"id": 7, "grasps": [{"T_cam_gripper": 3}]}]}, True),
        ({"objects": [{"id": 7, "grasps": [{"score": 0.9}]}]}, True),
        ({"objects": 3}, True),
    ],
)
def test_a_damaged_one_ends_nothing(tmp_path, change, refused):
    (tmp_path / RECORD).write_text(json.dumps(WHOLE | change))
    assert stored_hands(tmp_path) == {}
    if refused:
        with pytest.raises(ResultError, match="grasps cannot be read") as caught:
            stored_grasps(tmp_path)
        assert_for_people(caught.value)
