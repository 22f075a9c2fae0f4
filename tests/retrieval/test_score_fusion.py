from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config.retrieval import FusionConfig, IlluminantsConfig
from brrp_cli.retrieval.base import unknown
from brrp_cli.retrieval.illuminants import lights, local_lights, log_prior
from brrp_cli.retrieval.score_fusion import Similarity, believe, looks_difference

WEIGHTS = FusionConfig(
    colour=20.0, pairs=20.0, size=0.5, fit=0.0, usual=1.0, offset=8.0, crowding=1.0
)
FLAT, SAME = np.zeros(2), np.eye(2)


def seen(colour, pairs=(1.0, 1.0), size=(0.0, 0.0), hidden=0.0, points=10**9):
    return Similarity(
        rows=np.arange(2),
        colour=np.array(colour, np.float32),
        pairs=np.array(pairs, np.float32),
        size=np.array(size, np.float32),
        hidden=hidden,
        points=points,
    )


def test_one_light_shines_on_all():
    # Two lights: in the first it is object 0, in the second object 1. The neighbour settles it.
    torn = seen([[1.0, 0.5], [0.5, 1.0]])
    alone = believe([torn], FLAT, SAME, 2, WEIGHTS)[0]
    assert alone[0] == pytest.approx(alone[1])
    neighbour = seen([[1.0, 0.3], [0.3, 0.3]])
    together = believe([torn, neighbour], FLAT, SAME, 2, WEIGHTS)[0]
    assert together[0] > 0.95 and together[0] > 50 * together[1]
    # Where light differs freely from object to object, the neighbour says nothing.
    free = believe([torn, neighbour], FLAT, np.full((2, 2), 0.5), 2, WEIGHTS)[0]
    assert free[0] == pytest.approx(free[1])


def test_what_is_like_nothing_is_unknown():
    alike, strange = seen([[1.0, 0.2]] * 2), seen([[0.3, 0.2]] * 2, pairs=(0.8, 0.7))
    found = believe([alike, strange], FLAT, SAME, 2, WEIGHTS)
    assert unknown(found[0]) < 0.01 and unknown(found[1]) > 0.99


def test_the_formula_in_plain_numbers():
    # One light: log odds 8 - 20 * 0.1 - 0.5 * 3 - ln 2 and 8 - 20 * 0.2 * (1 - 0.5) - ln 2.
    item = seen([[0.9, 1.0]], pairs=(1.0, 0.8), size=(-3.0, 0.0), hidden=0.5)
    found = believe([item], np.zeros(1), np.eye(1), 2, WEIGHTS)[0]
    odds = np.exp([8 - 2 - 1.5, 8 - 2.0]) / 2
    np.testing.assert_allclose(found, odds / (1 + odds.sum()), rtol=1e-5)


def test_evidence_counts_for_more_in_larger_priors():
    # Four times as many objects as `few`, to the power 1/2: twice the log odds.
    item = seen([[0.9, 1.0]], pairs=(1.0, 0.8), size=(-3.0, 0.0), hidden=0.5)
    weights = replace(WEIGHTS, few=50, many=200, sharper=0.5)
    found = believe([item], np.zeros(1), np.eye(1), 200, weights)[0]
    odds = np.exp(2 * (np.array([8 - 2 - 1.5, 8 - 2.0]) - np.log(200)))
    np.testing.assert_allclose(found[:2], odds / (1 + odds.sum()), rtol=1e-5)
    # Not for more than that in even larger ones: only the crowding grows.
    crowded = believe([item], np.zeros(1), np.eye(1), 800, weights)[0]
    odds = np.exp(2 * (np.array([8 - 2 - 1.5, 8 - 2.0]) - np.log(800)))
    np.testing.assert_allclose(crowded[:2], odds / (1 + odds.sum()), rtol=1e-5)
    # In smaller ones they are as they are.
    small = believe([item], np.zeros(1), np.eye(1), 2, weights)[0]
    plain = believe([item], np.zeros(1), np.eye(1), 2, replace(weights, sharper=0.0))[0]
    np.testing.assert_array_equal(small, plain)


def test_alignment_counts_for_each_object():
    # Log odds 8 - 10 * 0.1 - ln 2 and 8 - 10 * 0.6 - ln 2.
    item = replace(seen([[1.0, 1.0]]), alignment=np.array([0.9, 0.4], np.float32))
    weights = replace(WEIGHTS, alignment=10.0, fit=10.0)
    found = believe([item], np.zeros(1), np.eye(1), 2, weights)[0]
    odds = np.exp([7.0, 2.0]) / 2
    np.testing.assert_allclose(found, odds / (1 + odds.sum()), rtol=1e-5)
    half = believe([item], np.zeros(1), np.eye(1), 2, replace(weights, crowding=0.5))[0]
    odds *= np.sqrt(2)
    np.testing.assert_allclose(half, odds / (1 + odds.sum()), rtol=1e-5)


def test_what_none_lies_well_over_speaks_less_against_all():
    """Log odds 8 - 4 * 0.1 - ln 2 and 8 - 4 * 0.1 - 10 * 0.5 - ln 2."""
    item = replace(seen([[1.0, 1.0]]), alignment=np.array([0.9, 0.4], np.float32))
    weights = replace(WEIGHTS, alignment=10.0, fit=4.0)
    found = believe([item], np.zeros(1), np.eye(1), 2, weights)[0]
    odds = np.exp([7.6, 2.6]) / 2
    np.testing.assert_allclose(found, odds / (1 + odds.sum()), rtol=1e-5)


def test_what_lies_badly_over_wavy_depth_speaks_less_against_all():
    """Waves four times as high as `wave`: log odds 8 - 4 / 4 * 0.1 - ln 2, and 5 less."""
    item = replace(seen([[1.0, 1.0]]), alignment=np.array([0.9, 0.4], np.float32), wave=0.002)
    weights = replace(WEIGHTS, alignment=10.0, fit=4.0, wave=0.0005)
    found = believe([item], np.zeros(1), np.eye(1), 2, weights)[0]
    odds = np.exp([7.9, 2.9]) / 2
    np.testing.assert_allclose(found, odds / (1 + odds.sum()), rtol=1e-5)
    calm = believe([replace(item, wave=0.0004)], np.zeros(1), np.eye(1), 2, weights)[0]
    odds = np.exp([7.6, 2.6]) / 2
    np.testing.assert_allclose(calm, odds / (1 + odds.sum()), rtol=1e-5)


def test_alignment_with_few_points_counts_less():
    """At `points` points half: log odds 8 - 5 * 0.1 - ln 2 and 8 - 5 * 0.6 - ln 2."""
    weights = replace(WEIGHTS, alignment=10.0, fit=10.0, points=300.0)
    item = replace(seen([[1.0, 1.0]], points=300), alignment=np.array([0.9, 0.4], np.float32))
    found = believe([item], np.zeros(1), np.eye(1), 2, weights)[0]
    odds = np.exp([7.5, 5.0]) / 2
    np.testing.assert_allclose(found, odds / (1 + odds.sum()), rtol=1e-5)


def test_silhouettes_speak_against_placements():
    """Log odds 8 - 10 * 0.2 - ln 2 and 8 - 10 * 0.3 - 4 ln(1 + 0.5) - ln 2: what is bare beyond
    0.3 counts no more."""
    weights = replace(WEIGHTS, bare=10.0, spilled=4.0, most_bare=0.3)
    item = replace(
        seen([[1.0, 1.0]]),
        bare=np.array([0.2, 0.9], np.float32),
        spilled=np.array([0.0, 0.5], np.float32),
    )
    found = believe([item], np.zeros(1), np.eye(1), 2, weights)[0]
    odds = np.exp([6.0, 5 - 4 * np.log(1.5)]) / 2
    np.testing.assert_allclose(found, odds / (1 + odds.sum()), rtol=1e-5)
    # Waves twice as high as `wave`: half of it.
    wavy = replace(item, wave=2 * weights.wave)
    found = believe([wavy], np.zeros(1), np.eye(1), 2, weights)[0]
    odds = np.exp([7.0, 6.5 - 2 * np.log(1.5)]) / 2
    np.testing.assert_allclose(found, odds / (1 + odds.sum()), rtol=1e-5)


def test_looks_count_for_more_with_other_weights():
    item = seen([[1.0, 0.2], [0.9, 0.6]], pairs=(0.9, 0.5), size=(-1.0, -2.0), hidden=0.5)
    others = replace(WEIGHTS, pairs=10.0, size=0.1, colour=30.0)
    # 20 (B - 1) + 20 (1 - h) (D - 1) + 0.5 Z becomes 30 (B - 1) + 10 (1 - h) (D - 1) + 0.1 Z.
    found = looks_difference(item, WEIGHTS, others)
    np.testing.assert_allclose(found, [0.5 + 0.4, -4 + 2.5 + 0.8], rtol=1e-5)


def test_objects_that_were_not_looked_at_have_no_probability():
    item = Similarity(
        np.array([4, 1]), *(np.ones(s, np.float32) for s in ((2, 2), 2)), np.zeros(2), 0, 1000
    )
    found = believe([item], FLAT, SAME, 6, WEIGHTS)[0]
    assert (found > 0).tolist() == [False, True, False, False, True, False]


def test_lights_are_near_each_other():
    gains = lights(IlluminantsConfig())
    lit = IlluminantsConfig()
    prior, local = log_prior(gains, lit), local_lights(gains, lit)
    plain = int(np.abs(np.log(gains)).sum(axis=1).argmin())
    assert prior[plain] > prior.max() - 0.2
    np.testing.assert_allclose(local.sum(axis=1), 1)
    assert local[plain].argmax() == plain
