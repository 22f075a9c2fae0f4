"""What became of masks that are wrong in one way, and how often weights are right."""

from __future__ import annotations

import numpy as np
import pytest
import small_prior
from score_recognition import cause, report, rows_of, weights_told
from tiny_scenes import write_meshes, write_scene

from brrp_cli.ground_truth.scenes import find_scenes
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.store import open_prior
from brrp_cli.session import Reconstructor

TRUTH = np.repeat([0, 1, 2], [100, 100, 100])


def masks(*lengths):
    """Ids 0, 1, 2, ... repeated so many times."""
    return np.repeat(np.arange(len(lengths)), lengths)


@pytest.mark.parametrize(
    ("found", "why", "shared"),
    [
        (masks(100, 100, 100), "own", []),
        (masks(100, 200), "shared", [2]),
        (masks(100, 50, 50, 100), "pieces", []),
        (masks(50, 150, 100), "table", []),
        (masks(140, 60, 100), "part", []),
        (np.where(np.arange(300) < 200, 0, 2), "missing", []),
        (masks(80, 100, 120), "rough", []),
    ],
)
def test_the_cause_is_told(found, why, shared):
    assert cause(TRUTH, found, 1) == (why, shared)


def taken(weight, right):
    """A mask that was taken for a can with that weight."""
    return {"scene": "0", "taken": "can", "weight": weight, "is": "can" if right else "box"}


def test_weights_are_held_against_what_is_right():
    rows = [taken(0.6, True), taken(0.6, False), taken(0.8, False), taken(1.0, True)]
    # |0.5 - 0.6| of two masks, |0 - 0.8| of one and none of the last.
    assert weights_told(rows) == (
        "weights  ECE 0.250; right, 0.5 to 0.8: 1 of 2, 0.8 to 0.95: 0 of 1, 0.95 to 1: 1 of 1"
    )


def test_masks_that_are_something_else_count_as_wrong():
    told = report("set", [taken(0.9, True), taken(0.7, False), {"scene": "0", "masks": 3}])
    assert "1 of 3 masks wrong" in told


def test_of_a_frame_in_which_nothing_is_found_all_are_missing(tmp_path, capsys):
    build_prior(write_meshes(tmp_path / "shapes"), tmp_path / "prior", small_prior.SMALL, workers=1)
    write_scene(tmp_path / "scenes" / "a", {9: ("can", -0.1, 0.03), 3: ("ball", 0.09, 0.0)})
    depth = tmp_path / "scenes" / "a" / "0000" / "depth.npy"
    seen = np.load(depth)
    # No table: depth on the things alone.
    masks = np.load(depth.with_name("seg_mask.npy"))
    np.save(depth, np.where(masks > 0, seen, np.float32(1.0)))
    prior = open_prior(tmp_path / "prior")
    again = Reconstructor(prior, retriever="appearance", workers=1, helpers=0)
    (scene,) = find_scenes(tmp_path / "scenes")
    rows = rows_of(scene, again, prior, tmp_path, given=False, least=50)
    assert [(row["object"], row["cause"], row["recognised"]) for row in rows[:-1]] == [
        ("ball", "missing", False),
        ("can", "missing", False),
    ]
    assert rows[-1]["masks"] == 0
    assert "a: " in capsys.readouterr().err
