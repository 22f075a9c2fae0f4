import math

import numpy as np
import pytest
import trimesh

from brrp_cli.evaluation.recognition import (
    RECOGNITION,
    RECOGNITION_FIGURES,
    half_extent,
    recognition,
    with_recognition,
)
from brrp_cli.geometry import similarity
from brrp_cli.reconstruction import OK, ObjectReconstruction, Retrieved

TURN = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3]


def item(*weights, unknown=0.0, size=0.1):
    """Stored objects `a`, `b`, ... with these weights, each placed with this half extent."""
    retrieved = [
        Retrieved(name, 0.5, similarity(size, TURN, [0, 0, 1.0]), weight=weight)
        for name, weight in zip("abc", weights, strict=False)
    ]
    return ObjectReconstruction(1, OK, retrieved=retrieved, unknown_weight=unknown)


def test_most_weight_decides():
    found = recognition(item(0.2, 0.5, unknown=0.3), "b", True, 0.1)
    assert set(found) == set(RECOGNITION)
    assert found["recognised"] and (found["taken_for"], found["weight_best"]) == ("b", 0.5)
    assert found["weight_true"] == 0.5 and found["size_factor"] == pytest.approx(1.0)
    wrong = recognition(item(0.2, 0.5, unknown=0.3), "a", True, 0.1)
    assert not wrong["recognised"] and wrong["taken_for"] == "b" and wrong["weight_true"] == 0.2
    assert wrong["size_factor"] is None
    none = recognition(item(0.2, 0.3, unknown=0.5), "b", True, 0.1)
    assert not none["recognised"]
    missed = recognition(item(0.2, 0.3, unknown=0.5), "z", True, 0.1)
    assert not missed["recognised"] and missed["weight_true"] == 0.0


def test_size_is_over_the_true_one():
    found = recognition(item(1.0, size=0.09), "a", True, 0.1)
    assert found["size_factor"] == pytest.approx(0.9)


def test_a_stranger_is_not_recognised_nor_missed():
    found = recognition(item(0.7, 0.1, unknown=0.2), "stranger", False, 0.1)
    assert found == {"taken_for": "a", "weight_best": 0.7}


def test_without_weights_there_is_nothing_to_say():
    plain = ObjectReconstruction(1, OK, retrieved=[Retrieved("a", 0.9, np.eye(4))])
    assert recognition(plain, "a", True, 0.1) == {}
    assert recognition(ObjectReconstruction(1, OK), "a", True, 0.1) == {}


def test_the_half_extent_is_along_the_objects_own_axes():
    T_world_object = similarity(2.0, TURN, [4.0, 5.0, 6.0])
    box = trimesh.creation.box((0.3, 0.1, 0.2)).apply_transform(T_world_object)
    assert half_extent(box.vertices, T_world_object) == pytest.approx(0.3)


def figures(**row):
    found = with_recognition({"visible_pixels": 1000, **row})
    return {name: found[name] for name in RECOGNITION_FIGURES if name in found}


def test_each_figure_is_over_the_objects_that_it_asks_for():
    known = {"recognised": True, "weight_true": 0.9, "weight_best": 0.9, "placement_error": 0.001}
    assert figures(**known, size_factor=1.01) == {
        "recognised_clear": True,
        "weight_true_clear": 0.9,
        "other_size": False,
        "placement_recognised": 0.001,
    }
    assert figures(**known, size_factor=0.97)["other_size"] is True
    assert figures(**known, size_factor=math.nan)["other_size"] is True
    small = figures(**known, size_factor=1.0, visible_pixels=999)
    assert small == {"other_size": False, "placement_recognised": 0.001}
    missed = figures(recognised=False, weight_true=0.1, weight_best=0.6, size_factor=None)
    assert missed == {"recognised_clear": False, "weight_true_clear": 0.1}
    assert figures(weight_best=0.51) == {"stranger_taken": True}
    assert figures(weight_best=0.5, visible_pixels=20) == {"stranger_taken": False}
    assert figures() == {}


def test_a_pose_is_right_within_a_tenth_of_the_diameter():
    known = {"recognised": True, "size_factor": 1.0, "visible_pixels": 20, "diameter": 0.2}
    right = {"pose_recognised": 0.019, "pose_right": True, "pose_told": True}
    found = figures(**known, pose_error=0.019, least_pose_error=0.019)
    assert found == {"other_size": False, **right}
    found = figures(**known, pose_error=0.021, least_pose_error=0.01)
    assert (found["pose_right"], found["pose_told"]) == (False, True)
    assert figures(**known, pose_error=0.03, least_pose_error=0.021)["pose_told"] is False
