"""How much each hypothesis counts, and the one that the object is none of the stored ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config import WeighConfig
from brrp_cli.registration.weigh import piece_doubt, weigh

CONFIG = WeighConfig()


def test_weights_are_a_distribution_over_hypotheses_and_the_unknown():
    rng = np.random.default_rng(0)
    for _ in range(200):
        count = int(rng.integers(0, 12))
        shares, ratios = rng.random(count), rng.uniform(-80, 40, count)
        weights = weigh(shares, ratios, rng.random(), CONFIG)
        assert weights.shape == (count + 1,)
        assert (weights >= 0).all() and weights.sum() == pytest.approx(1)


def test_the_formula_on_numbers():
    """P(c|R) times the likelihood ratio: 0.6 and 0.2 of 0.8, unknown 0.2 with a ratio of 1."""
    weights = weigh([0.6, 0.2], [np.log(2.0), np.log(10.0)], 0.2, CONFIG)
    raw = np.array([0.6 * 2, 0.2 * 10, 0.2])
    np.testing.assert_allclose(weights, raw / raw.sum())


def test_a_larger_ratio_is_more_weight():
    found = [weigh([0.4, 0.4], [e, -4.0], 0.2, CONFIG) for e in np.linspace(-30, 30, 21)]
    first, others = np.array(found)[:, 0], np.array(found)[:, 1:]
    assert (np.diff(first) > 0).all() and (np.diff(others, axis=0) <= 0).all()
    assert first[0] < 1e-9 and first[-1] > 0.999


def test_a_more_probable_object_has_more_weight():
    found = [weigh([p, 0.9 - p], [0.7, 0.7], 0.1, CONFIG)[:2] for p in np.linspace(0.05, 0.85, 9)]
    assert (np.diff(found, axis=0) * [1, -1] > 0).all()


def test_equal_hypotheses_have_equal_weights():
    weights = weigh([0.3, 0.3, 0.3], [0.5, 0.5, 0.5], 0.1, CONFIG)
    assert weights[0] == weights[1] == weights[2]


def test_what_the_retriever_does_not_know_is_unknown_unless_evidence_is_beyond_doubt():
    assert weigh([0.0, 0.0], [-3.0, -8.0], 1.0, CONFIG)[-1] > 0.9
    assert weigh([0.0, 0.0], [8.0, -8.0], 1.0, CONFIG)[-1] < 0.1


def test_a_retriever_that_knows_nothing_is_no_other_than_one_that_knows_next_to_nothing():
    nothing = weigh([0.0, 0.0], [4.0, 1.0], 1.0, CONFIG)
    np.testing.assert_allclose(nothing, weigh([1e-9, 1e-9], [4.0, 1.0], 1.0, CONFIG), rtol=1e-6)


def test_a_retriever_that_is_certain_may_still_be_wrong():
    """It says that the object is stored: where nothing fits, it is something else all the same."""
    assert weigh([1.0], [-15.0], 0.0, CONFIG)[-1] > 0.9
    assert weigh([1.0], [8.0], 0.0, CONFIG)[-1] < 0.01


def test_the_more_is_missing_the_more_weight_has_the_unknown():
    found = [weigh([1 - m], [0.0], m, CONFIG)[-1] for m in np.linspace(0, 1, 11)]
    assert (np.diff(found) >= -1e-12).all()
    assert found[0] == pytest.approx(CONFIG.least_unknown)
    assert found[-1] == pytest.approx(CONFIG.most_unknown)


def test_an_object_that_the_retriever_calls_impossible_can_win_by_likelihood():
    weights = weigh([1.0, 0.0], [-15.0, 10.0], 0.0, CONFIG)
    assert weights.argmax() == 1


def test_what_is_impossible_weighs_nothing():
    np.testing.assert_array_equal(weigh([0.5, 0.5], [-np.inf, -np.inf], 0.3, CONFIG), [0, 0, 1])


def test_without_hypotheses_all_is_unknown():
    np.testing.assert_array_equal(weigh([], [], 0.3, CONFIG), [1.0])


def test_doubt_is_added_to_the_odds_of_none():
    plain = weigh([0.6, 0.2], [2.0, 1.0], 0.2, CONFIG)
    doubted = weigh([0.6, 0.2], [2.0, 1.0], 0.2, CONFIG, doubt=1.5)
    odds = [np.log(w[-1] / w[:-1].sum()) for w in (plain, doubted)]
    assert odds[1] - odds[0] == pytest.approx(1.5)
    np.testing.assert_allclose(doubted[0] / doubted[1], plain[0] / plain[1])


@pytest.mark.parametrize("pixels, nats", [(600, 0.0), (5000, 0.0), (300, 2 * np.log(2))])
def test_only_in_small_masks_a_piece_is_likely(pixels, nats):
    config = replace(CONFIG, small=600, doubt=2.0)
    assert piece_doubt(pixels, config) == pytest.approx(nats)
    assert np.isfinite(piece_doubt(0, config))
