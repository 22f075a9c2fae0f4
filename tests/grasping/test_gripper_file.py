"""Grippers by name and from files."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest

from brrp_cli.errors import GripperError
from brrp_cli.grasping.gripper_file import gripper_names, open_gripper

MINE = """
name: Mine
opening: 0.1
finger: {length: 0.05, width: 0.02, thickness: 0.01}
palm: {width: 0.2, depth: 0.06, length: 0.07}
force: 40
source: a ruler
"""


def test_those_that_come_with_it_are_what_they_are_sold_as():
    openings = {name: open_gripper(name).opening for name in gripper_names()}
    assert openings == {"franka-hand": 0.08, "robotiq-2f-85": 0.085, "robotiq-2f-140": 0.14}
    for name in gripper_names():
        hand = open_gripper(name)
        assert hand.source and hand.name
        assert (files("brrp_cli.grasping") / "grippers" / f"{name}.yaml").is_file()
        # It closes from where its fingers stand inside the palm's width.
        assert hand.opening + 2 * hand.finger_thickness <= hand.palm_width + 0.02
    assert open_gripper("franka-hand").tip == pytest.approx(0.1129)


def test_one_more_is_one_file(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(MINE)
    hand = open_gripper(path)
    assert (hand.name, hand.opening, hand.tip) == ("Mine", 0.1, pytest.approx(0.12))
    boxes = hand.boxes(np.array([0.06]), back=0.1)[0]
    np.testing.assert_allclose(boxes[0], [[-0.04, -0.01, -0.03], [-0.03, 0.01, 0.12]])
    np.testing.assert_allclose(boxes[1], [[0.03, -0.01, -0.03], [0.04, 0.01, 0.12]])
    np.testing.assert_allclose(boxes[2], [[-0.1, -0.03, -0.1], [0.1, 0.03, 0.07]])


WRONG = {
    "nothing said": ("name: Mine", "opening"),
    "missing": (MINE.replace("width: 0.02, ", ""), "finger.width"),
    "text": (MINE.replace("0.1\n", "wide\n", 1), "opening"),
    "negative": (MINE.replace("length: 0.05", "length: -0.05"), "finger.length"),
    "millimetres": (MINE.replace("opening: 0.1", "opening: 100"), "opening"),
    "not finite": (MINE.replace("force: 40", "force: .inf"), "force"),
    "no table": ("- 1\n- 2", ""),
    "truth": (MINE.replace("opening: 0.1", "opening: true"), "opening"),
    "no YAML": ("a: [1", ""),
    "code": ("!!python/object/apply:os.system [ls]", ""),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_told_with_file_and_key(tmp_path, wrong):
    text, key = WRONG[wrong]
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(GripperError) as error:
        open_gripper(path)
    assert str(path) in str(error.value.where) and str(error.value.where).endswith(key)
    assert error.value.expected and error.value.found and error.value.fix


def test_the_one_that_was_meant_is_named(tmp_path):
    with pytest.raises(GripperError, match="did you mean franka-hand"):
        open_gripper("franka_hand")
    with pytest.raises(GripperError, match="No such file"):
        open_gripper(tmp_path / "none.yaml")
