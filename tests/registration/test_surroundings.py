"""Pixels beside a mask are told from the object by their colours alone."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.registration.surroundings import Surroundings, like_surroundings, surroundings

RED, GREY, BLUE = [200, 40, 40], [120, 120, 120], [40, 40, 200]


def picture():
    """A red square of 20 x 20 pixels on grey, with blue far away from it."""
    rgb = np.full((100, 120, 3), 120, np.uint8)
    own = np.zeros(rgb.shape[:2], dtype=bool)
    own[40:60, 50:70] = True
    rgb[own] = RED
    rgb[:10] = BLUE
    return rgb, own, ~own


def test_colours_are_the_objects_and_those_as_far_beside_it_as_it_is_wide():
    sides = surroundings(*picture(), 150)
    assert sides.own.shape == sides.around.shape == (150, 3)
    # Plain red and plain grey: no blue.
    assert np.ptp(sides.own, axis=0).max() < 1e-9 and np.ptp(sides.around, axis=0).max() < 1e-9


def test_colours_of_one_side_are_told_apart_and_those_of_none_or_both_are_not():
    sides = surroundings(*picture(), 150)
    colours = np.array([GREY, RED, BLUE], dtype=np.uint8)
    assert like_surroundings(colours, sides, 6.0) == pytest.approx([1, 0, 0.5], abs=1e-3)
    same = Surroundings(sides.own, sides.own)
    assert like_surroundings(colours, same, 6.0) == pytest.approx([0.5] * 3)


def test_a_shade_of_the_table_is_still_the_tables():
    rng = np.random.default_rng(0)
    rgb, own, background = picture()
    noisy = np.clip(rgb + rng.normal(0, 4, rgb.shape), 0, 255).astype(np.uint8)
    sides = surroundings(noisy, own, background, 150)
    assert like_surroundings(np.array([[112, 112, 112]], np.uint8), sides, 6.0) > 0.95


def test_without_an_object_or_a_background_nothing_is_told():
    rgb, own, background = picture()
    none = np.zeros_like(own)
    for sides in (surroundings(rgb, none, background, 150), surroundings(rgb, own, none, 150)):
        assert (like_surroundings(rgb[0, :2], sides, 6.0) == 0.5).all()
    assert like_surroundings(rgb[:0, 0], surroundings(rgb, own, background, 9), 6.0).shape == (0,)
