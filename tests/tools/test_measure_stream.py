"""What tools/measure_stream.py counts."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from measure_stream import KINDS, fits, follow, noisy
from test_tracking import START, scene


def test_a_mask_fits_the_object_that_it_covers():
    true = np.zeros((60, 80), np.int64)
    true[:20, :20], true[:20, 30:50], true[40:, :30] = 4, 7, 9
    found = np.zeros_like(true)
    found[:20, :19], found[:20, 30:40], found[40:, :30] = 2, 3, 8
    assert fits(true, found) == {4: 2, 9: 8}, "half of 7 is too little"
    assert fits(true, np.zeros_like(true)) == {}


def test_noise_goes_along_the_rays_and_grows_with_depth():
    frame = scene(START)
    loud = noisy(frame, np.random.default_rng(0))
    z, off = frame.depth[frame.valid], (loud.depth - frame.depth)[frame.valid]
    assert np.std(off / z**2) == pytest.approx(0.001, rel=0.05)
    rays = loud.points[frame.valid] / loud.depth[frame.valid][:, None]
    assert rays == pytest.approx(frame.points[frame.valid] / z[:, None], abs=1e-5)


def test_what_becomes_of_ids_and_names_is_counted():
    shown = scene(START)
    large = SimpleNamespace(
        name="s",
        views=("a", "b"),
        view=lambda number: shown,
        object=lambda i: SimpleNamespace(name=f"thing {i}"),
    )
    answers = iter([{1: 1, 2: 2, 3: 3}, {1: 1, 2: 3, 3: 9}])

    def session(frame):
        assert not frame.object_ids
        ids = next(answers)
        segmap = sum(np.where(shown.segmap == old, new, 0) for old, new in ids.items())
        names = {1: "thing 1", 2: "thing 1", 3: None}
        objects = [
            SimpleNamespace(
                object_id=new, recognised=names[old] and SimpleNamespace(name=names[old])
            )
            for old, new in ids.items()
        ]
        return SimpleNamespace(frame=replace(shown, segmap=segmap), objects=objects)

    told = follow(session, large, 1, 0)
    first, other = told[KINDS[0]], told[KINDS[2]]
    assert (first["found"], first["before"], first["right"], first["wrong"]) == (3, 0, 1, 1)
    assert (other["before"], other["kept"], other["swapped"]) == (3, 1, 1)
    assert not told[KINDS[1]]
