"""Metrics of probabilities against values known in closed form."""

import math

import numpy as np
import pytest

from brrp_cli.evaluation.calibration import (
    ause,
    brier,
    expected_calibration_error,
    negative_log_likelihood,
    reliability,
    sparsification,
)


def drawn(probability, seed=0):
    return np.random.default_rng(seed).random(len(probability)) < probability


def test_brier_by_hand():
    probability, label = np.array([1.0, 0.0, 0.5, 0.25]), np.array([True, True, False, False])
    assert brier(probability, label) == pytest.approx((0 + 1 + 0.25 + 0.0625) / 4)


def test_negative_log_likelihood_by_hand_and_clipped():
    assert negative_log_likelihood(np.array([0.5, 0.5]), np.array([True, False])) == pytest.approx(
        math.log(2)
    )
    assert negative_log_likelihood(np.array([0.9]), np.array([True])) == pytest.approx(
        -math.log(0.9)
    )
    certain_and_wrong = negative_log_likelihood(np.array([0.0, 1.0]), np.array([True, False]))
    assert certain_and_wrong == pytest.approx(-math.log(1e-6))
    assert negative_log_likelihood(np.array([0.0]), np.array([True]), clip=1e-3) == pytest.approx(
        -math.log(1e-3)
    )


def test_clipping_holds_for_single_precision():
    assert math.isfinite(
        negative_log_likelihood(np.array([1.0], dtype=np.float32), np.array([False]))
    )


def test_reliability_puts_every_point_into_its_bin():
    probability = np.array([0.0, 0.05, 0.1, 0.55, 1.0])
    label = np.array([False, True, False, True, True])
    diagram = reliability(probability, label)
    assert diagram.count.tolist() == [2, 1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert diagram.confidence[0] == pytest.approx(0.025)
    assert diagram.frequency[0] == pytest.approx(0.5)
    assert np.isnan(diagram.confidence[2])
    assert np.isnan(diagram.frequency[2])


def test_a_calibrated_predictor_has_no_calibration_error():
    probability = np.random.default_rng(1).random(200_000)
    assert expected_calibration_error(probability, drawn(probability)) < 0.005


def test_an_overconfident_predictor_is_off_by_its_overconfidence():
    # It says 0.95 and 0.05 where 0.75 and 0.25 is right.
    truth = np.repeat([0.75, 0.25], 100_000)
    said = np.where(truth > 0.5, 0.95, 0.05)
    assert expected_calibration_error(said, drawn(truth)) == pytest.approx(0.2, abs=0.005)


def test_exact_calibration_error_by_hand():
    probability = np.array([0.9, 0.9, 0.9, 0.9, 0.1])
    label = np.array([True, True, False, False, False])
    assert expected_calibration_error(probability, label) == pytest.approx((4 * 0.4 + 1 * 0.1) / 5)


def test_a_perfect_ranking_has_no_sparsification_error():
    error = np.random.default_rng(0).random(1000)
    assert ause(error, error) == pytest.approx(0, abs=1e-12)
    assert ause(error, np.exp(5 * error)) == pytest.approx(0, abs=1e-12)


def test_sparsification_by_hand():
    np.testing.assert_allclose(
        sparsification(np.array([1.0, 3.0]), np.array([0.0, 1.0])), [1.0, 0.5]
    )
    np.testing.assert_allclose(
        sparsification(np.array([1.0, 3.0]), np.array([1.0, 0.0])), [1.0, 1.5]
    )


def test_an_uncertainty_that_ranks_nothing_has_the_area_known_in_closed_form():
    # Half of the points have error 1. The curve stays at 1; the oracle's is (1 - 2f) / (1 - f)
    # up to f = 1/2 and 0 after. The area between them is ln 2.
    error = np.repeat([1.0, 0.0], 5000)
    assert ause(error, np.zeros(10_000)) == pytest.approx(math.log(2), abs=1e-3)


def test_ties_do_not_depend_on_the_order_of_the_input():
    rng = np.random.default_rng(0)
    error, uncertainty = rng.random(500), rng.integers(0, 4, 500).astype(float)
    order = rng.permutation(500)
    assert ause(error, uncertainty) == pytest.approx(ause(error[order], uncertainty[order]))


def test_a_reversed_ranking_is_worse_than_none():
    error = np.random.default_rng(0).random(1000)
    assert ause(error, -error) > ause(error, np.zeros(1000)) > 0


def test_nothing_has_no_value_and_no_error_has_nothing_to_rank():
    none, no_label = np.zeros(0), np.zeros(0, dtype=bool)
    assert math.isnan(brier(none, no_label))
    assert math.isnan(negative_log_likelihood(none, no_label))
    assert math.isnan(expected_calibration_error(none, no_label))
    assert math.isnan(ause(none, none))
    assert ause(np.zeros(5), np.arange(5.0)) == 0.0
