import math

import numpy as np
import pytest

from brrp_cli.evaluation.bootstrap import calibration_interval, mean_interval, median_interval


def rng():
    return np.random.default_rng(0)


def test_interval_of_independent_values_is_that_of_the_normal_law():
    values = np.random.default_rng(1).normal(3.0, 2.0, 900)
    found = mean_interval(values, [str(i) for i in range(900)], rng())
    half = 1.96 * values.std() / math.sqrt(900)
    assert found.value == pytest.approx(values.mean())
    assert found.low == pytest.approx(values.mean() - half, abs=0.1 * half)
    assert found.high == pytest.approx(values.mean() + half, abs=0.1 * half)
    assert found.count == 900


def test_copies_within_a_scene_tell_nothing_new():
    values = np.random.default_rng(2).normal(size=60)
    scenes = [str(i) for i in range(60)]
    once = mean_interval(values, scenes, rng())
    thrice = mean_interval(np.repeat(values, 3), np.repeat(scenes, 3), rng())
    assert (thrice.low, thrice.high) == pytest.approx((once.low, once.high))
    # Taken for independent, they would.
    naive = mean_interval(np.repeat(values, 3), [str(i) for i in range(180)], rng())
    assert naive.high - naive.low < 0.7 * (once.high - once.low)


def test_objects_weigh_alike_not_scenes():
    found = mean_interval([1.0, 1.0, 1.0, 5.0], ["a", "a", "a", "b"], rng())
    assert found.value == 2.0
    # Draws of two scenes: aa, ab or ba, bb.
    assert (found.low, found.high) == (1.0, 5.0)


def test_values_that_are_not_there_are_left_out():
    found = mean_interval([2.0, math.nan, 4.0], ["a", "b", "c"], rng())
    assert (found.value, found.count) == (3.0, 2)
    none = mean_interval([math.nan], ["a"], rng())
    assert math.isnan(none.value) and none.count == 0


def test_one_scene_has_no_interval():
    found = mean_interval([1.0, 2.0], ["a", "a"], rng())
    assert found.value == 1.5 and math.isnan(found.low) and math.isnan(found.high)


def test_calibration_error_of_a_set_is_that_of_its_pooled_points():
    # Two objects that are off by as much in opposite directions are calibrated together.
    low = np.array([[10, 0], [5.0, 0], [3, 0]])
    high = np.array([[10, 0], [5.0, 0], [7, 0]])
    assert calibration_interval([low, high], ["a", "b"], rng()).value == 0.0
    apart = calibration_interval([low], ["a"], rng())
    assert apart.value == pytest.approx(0.2) and math.isnan(apart.low)


@pytest.mark.parametrize("count", [301, 300])
def test_median_of_independent_values_is_that_of_the_normal_law(count):
    values = np.random.default_rng(1).normal(3.0, 2.0, count)
    found = median_interval([*values, math.nan], [str(i) for i in range(count + 1)], rng())
    assert found.value == pytest.approx(np.median(values)) and found.count == count
    half = 1.96 * 2.0 * math.sqrt(math.pi / 2 / count)
    assert found.high - found.low == pytest.approx(2 * half, rel=0.3)


def test_medians_of_few_scenes():
    found = median_interval([1.0, 1.0, 1.0, 5.0], ["a", "a", "a", "b"], rng())
    # Draws of two scenes: aa, ab or ba, bb.
    assert (found.value, found.low, found.high) == (1.0, 1.0, 5.0)
    assert median_interval([1.0, 4.0], ["a", "a"], rng()).value == 2.5
    none = median_interval([math.nan], ["a"], rng())
    assert math.isnan(none.value) and none.count == 0
