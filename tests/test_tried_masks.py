"""In a mask that was looked into from about the same side nothing is looked for again."""

from __future__ import annotations

import numpy as np
import pytest
from test_tracking import GREEN, START, scene

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.tracking.tried import tried_before

TRACK = TrackConfig()
EVERY = {1, 2, 3}


def after(then, now, ids=EVERY):
    return tried_before(dict.fromkeys(ids, then), now, TRACK)


@pytest.mark.parametrize(("yaw", "again"), [(0.4, EVERY), (0.5, EVERY), (1.0, set())])
def test_from_about_the_same_side_nothing_new_is_seen(yaw, again):
    then, now = scene(START, known=True), scene(START, yaw=yaw, known=True)
    assert after(then, now) == again


def test_what_moved_is_looked_into_again():
    then = scene(START, known=True)
    now = scene(START | {GREEN: (0.12, 0.13)}, known=True)
    green = int(np.median(then.segmap[(then.rgb == GREEN).all(axis=-1)]))
    order = {i: i for i in EVERY}
    assert [int(i) for i in np.unique(now.segmap) if i] == sorted(order)
    assert green not in after(then, now)


def test_a_mask_that_is_another_is_looked_into():
    then = scene(START, known=True)
    columns = np.broadcast_to(np.arange(then.shape[1]), then.shape)
    two = then.segmap == 2
    half = then.with_masks(np.where(two & (columns > np.median(columns[two])), 9, then.segmap))
    assert after(then, half) == {1, 3}
    assert after(half, then) == {1, 3}


def test_what_was_not_looked_into_is():
    then = scene(START, known=True)
    assert after(then, then, {1}) == {1} and after(then, then, ()) == set()
    away = scene(START, yaw=1.2)
    assert after(scene(START), away) == set(), "nobody knows how the camera has moved"
