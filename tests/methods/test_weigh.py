"""How much each hypothesis counts, and the one that the object is none of the stored ones."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.config import WeighConfig
from brrp_cli.methods.brrp_default import weigh

CONFIG = WeighConfig()


def test_weights_are_a_distribution_over_hypotheses_and_the_unknown():
    rng = np.random.default_rng(0)
    for _ in range(200):
        count = int(rng.integers(0, 12))
        shares, alignment_score = rng.random(count), rng.uniform(-2, 1, count)
        weights = weigh(shares, alignment_score, rng.random(), CONFIG)
        assert weights.shape == (count + 1,)
        assert (weights >= 0).all() and weights.sum() == pytest.approx(1)


def test_the_formula_on_numbers():
    """P(c|R) exp(25 alignment score): 0.6 and 0.2 of 0.8, unknown 0.2 with alignment score 0.65."""
    config = WeighConfig(sharpness=25.0, unknown_score=0.65)
    weights = weigh([0.6, 0.2], [0.6, 0.64], 0.2, config)
    raw = np.array([0.6 * np.exp(25 * 0.6), 0.2 * np.exp(25 * 0.64), 0.2 * np.exp(25 * 0.65)])
    np.testing.assert_allclose(weights, raw / raw.sum())


def test_more_evidence_is_more_weight():
    found = [weigh([0.4, 0.4], [e, 0.6], 0.2, CONFIG) for e in np.linspace(-1, 1, 21)]
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
    assert weigh([0.0, 0.0], [0.6, 0.5], 1.0, CONFIG)[-1] > 0.9
    assert weigh([0.0, 0.0], [0.95, 0.5], 1.0, CONFIG)[-1] < 0.1


def test_a_retriever_that_knows_nothing_is_no_other_than_one_that_knows_next_to_nothing():
    nothing = weigh([0.0, 0.0], [0.8, 0.7], 1.0, CONFIG)
    np.testing.assert_allclose(nothing, weigh([1e-9, 1e-9], [0.8, 0.7], 1.0, CONFIG), rtol=1e-6)


def test_a_retriever_that_is_certain_may_still_be_wrong():
    """It says that the object is stored: where nothing fits, it is something else all the same."""
    assert weigh([1.0], [0.2], 0.0, CONFIG)[-1] > 0.9
    assert weigh([1.0], [0.95], 0.0, CONFIG)[-1] < 0.01


def test_the_more_is_missing_the_more_weight_has_the_unknown():
    found = [weigh([1 - m], [CONFIG.unknown_score], m, CONFIG)[-1] for m in np.linspace(0, 1, 11)]
    assert (np.diff(found) >= -1e-12).all()
    assert found[0] == pytest.approx(CONFIG.least_unknown)
    assert found[-1] == pytest.approx(CONFIG.most_unknown)


def test_an_object_that_the_retriever_calls_impossible_can_win_by_evidence():
    weights = weigh([1.0, 0.0], [0.3, 0.95], 0.0, CONFIG)
    assert weights.argmax() == 1


def test_without_hypotheses_all_is_unknown():
    np.testing.assert_array_equal(weigh([], [], 0.3, CONFIG), [1.0])
