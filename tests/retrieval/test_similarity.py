from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config.retrieval import RetrievalConfig, SimilarityConfig
from brrp_cli.descriptors.colour_histogram import (
    AB_BINS,
    COLOUR_BINS,
    L_BINS,
    colour_histograms,
)
from brrp_cli.descriptors.descriptor import to_bytes
from brrp_cli.descriptors.point_pairs import PAIR_BINS
from brrp_cli.prior.appearance_index import first_look
from brrp_cli.retrieval.observed_appearance import ObservedAppearance
from brrp_cli.retrieval.shortlist import Shortlist, best_of_each
from brrp_cli.retrieval.similarity import (
    blurred,
    colour_likeness,
    pair_likeness,
    size_penalty,
)

LIKE = SimilarityConfig()
POSES = np.array([[[0.2, 0.1, 0.05], [0.05, 0.2, 0.1]]], np.float32)


@pytest.mark.parametrize(
    ("size", "hidden", "fits"),
    [
        ((0.2, 0.1, 0.05), 0.0, True),
        ((0.05, 0.2, 0.1), 0.0, True),
        ((0.2, 0.1, 0.02), 0.0, True),  # the far side is not seen
        ((0.1, 0.1, 0.05), 0.0, False),  # too low
        ((0.1, 0.1, 0.05), 0.9, True),  # its top may be hidden
        ((0.3, 0.1, 0.05), 0.9, False),  # larger than the object it never is
        ((0.2, 0.2, 0.2), 0.0, False),
    ],
)
def test_what_is_seen_may_be_smaller_but_not_larger(size, hidden, fits):
    penalty = float(size_penalty(np.array(size), POSES, hidden, LIKE)[0])
    assert penalty > -1 if fits else penalty < -4


def test_missing_poses_and_sizes_say_nothing():
    padded = np.concatenate([POSES, np.full((1, 3, 3), np.nan, np.float32)], axis=1)
    size = np.array([0.18, 0.1, 0.05])
    np.testing.assert_array_equal(
        size_penalty(size, padded, 0, LIKE), size_penalty(size, POSES, 0, LIKE)
    )
    assert size_penalty(None, POSES, 0, LIKE).tolist() == [0]


def test_point_pairs_that_are_not_alike_say_no_more_than_so_much():
    bins = np.zeros((2, 1, PAIR_BINS), np.float32)
    bins[0, 0, 3] = bins[1, 0, 9] = 1
    seen = bins[0, 0]
    stored = to_bytes(bins)
    assert pair_likeness(seen, stored, LIKE).tolist() == pytest.approx([1, 0.8], abs=0.01)
    small = replace(LIKE, least_pairs=0.0)
    assert pair_likeness(seen, stored, small).tolist() == pytest.approx([1, 0], abs=0.01)


def test_blur_shares_a_colour_with_its_neighbours_in_hue_and_chroma():
    grid = np.zeros((L_BINS, AB_BINS, AB_BINS), np.float32)
    grid[1, 3, 3], grid[2, 0, 6] = 0.6, 0.4
    found = blurred(grid.reshape(1, -1), 0.2).reshape(grid.shape)
    np.testing.assert_allclose(found.sum(axis=(1, 2)), grid.sum(axis=(1, 2)), atol=1e-6)
    across = np.array([0.2, 0.6, 0.2])
    np.testing.assert_allclose(found[1, 2:5, 2:5], 0.6 * np.outer(across, across), atol=1e-6)
    # What would leave the histogram stays at its edge.
    np.testing.assert_allclose(found[2, :2, 5:], 0.4 * np.outer([0.8, 0.2], [0.2, 0.8]), atol=1e-6)
    np.testing.assert_array_equal(blurred(grid.reshape(1, -1), 0.0), grid.reshape(1, -1))


def test_a_plain_colour_in_light_that_was_not_tried_is_still_alike():
    # Grey in light that is off by half a step of the illuminants: 0.84 without blur.
    grey, ones = np.full((1, 3), 128.0), np.ones((1, 3))
    stored = to_bytes(colour_histograms(grey, np.ones(1), ones))[:, None]
    off = colour_histograms(grey, np.ones(1), np.array([[1.026, 0.985, 0.974]]))
    sharp = colour_likeness(off, stored, 1, replace(LIKE, blur=0.0))
    assert sharp < 0.9 and colour_likeness(off, stored, 1, LIKE) > 0.95
    red = colour_histograms(np.array([[190.0, 40, 35]]), np.ones(1), ones)
    assert colour_likeness(red, stored, 1, LIKE) < 0.3


def test_in_an_image_without_hue_lightness_alone_is_compared():
    ones = np.ones((1, 3))

    def histogram(rgb):
        return colour_histograms(np.array([rgb], float), np.ones(1), ones)

    red, its_grey = [190.0, 40, 35], [101.0, 101, 101]
    stored = to_bytes(np.concatenate([histogram(red), histogram([250, 250, 250])]))[:, None]
    seen = histogram(its_grey)
    assert colour_likeness(seen, stored, 1, LIKE)[0, 0] < 0.3
    found = colour_likeness(seen, stored, 1, LIKE, hueless=True)[0] + LIKE.without_hue
    assert found[0] > 0.95 and found[1] < 0.5


def test_the_best_view_counts():
    rng = np.random.default_rng(0)
    views = rng.dirichlet(np.full(COLOUR_BINS, 0.05), (3, 4))
    found = colour_likeness(views[:, 2], to_bytes(views), 3, replace(LIKE, blur=0.0))
    np.testing.assert_allclose(np.diag(found), 1, atol=0.02)
    expected = np.einsum("gb,mvb->gmv", np.sqrt(views[:, 2]), np.sqrt(views)).max(axis=-1)
    np.testing.assert_allclose(found, expected, atol=0.02)


def test_objects_without_colours_are_neither_preferred_nor_refused():
    stored = np.zeros((2, 3, COLOUR_BINS), np.uint8)
    stored[1, :, 5] = 255
    seen = np.eye(COLOUR_BINS)[[5, 150]]
    np.testing.assert_allclose(
        colour_likeness(seen, stored, 2, LIKE), [[LIKE.plain_colour, 1], [LIKE.plain_colour, 0]]
    )
    np.testing.assert_allclose(colour_likeness(None, stored, 4, LIKE), LIKE.neutral_colour)


def many_objects(count, rng):
    """A table of descriptors, and the colours (count, 1, b) and pairs (count, 1, b) in it."""
    views = 4
    row = np.dtype(
        [
            ("colour", "u1", (views, COLOUR_BINS)),
            ("pairs", "u1", (views, PAIR_BINS)),
            ("sizes", "f4", (2, 3)),
        ]
    )
    table = np.zeros(count, row)
    colour = rng.dirichlet(np.full(COLOUR_BINS, 0.02), (count, 1))
    pairs = rng.dirichlet(np.full(PAIR_BINS, 0.3), (count, 1))
    table["colour"] = to_bytes(colour * np.ones((views, 1)))
    table["pairs"] = to_bytes(pairs * np.ones((views, 1)))
    table["sizes"] = rng.uniform(0.02, 0.3, (count, 2, 3))
    return table, colour, pairs


def test_a_shortlist_of_a_large_prior_holds_the_true_object():
    table, colour, pairs = many_objects(3_000, np.random.default_rng(3))
    shortlist = Shortlist(first_look(table), RetrievalConfig())
    for true in (7, 1234, 2999):
        size = table["sizes"][true, 0].astype(float)
        seen = ObservedAppearance(
            None, None, pairs[true, 0].astype(np.float32), size, np.zeros((0, 3)), 0.0
        )
        histograms = np.repeat(colour[true], 9, axis=0).astype(np.float32)
        rows = shortlist.rows(seen, histograms)
        assert (
            len(rows) == RetrievalConfig().shortlist.closely
            and true in rows
            and (np.diff(rows) > 0).all()
        )
        assert float(pair_likeness(seen.pairs, table["pairs"][[true]], LIKE)[0]) > 0.98


def test_objects_without_colours_do_not_crowd_out_the_others():
    table, colour, pairs = many_objects(3_000, np.random.default_rng(4))
    # All have the true object's shape and size, and no colours.
    true = 41
    for name in ("pairs", "sizes"):
        table[name] = table[name][true]
    table["colour"][:2_700] = 0
    table["colour"][true] = to_bytes(colour[true])
    seen = ObservedAppearance(
        None,
        None,
        pairs[true, 0].astype(np.float32),
        table["sizes"][true, 0].astype(float),
        np.zeros((0, 3)),
        0.0,
    )
    # In light that was not tried it is less alike than those without colours are taken to be.
    off = 0.7 * colour[true] + 0.3 * colour[(true + 1) % 50]
    rows = Shortlist(first_look(table), RetrievalConfig()).rows(
        seen, np.repeat(off, 9, axis=0).astype(np.float32)
    )
    assert true in rows and (np.diff(rows) > 0).all()
    assert (rows < 2_700).sum() == RetrievalConfig().shortlist.closely + 1


def test_the_best_of_each_kind_are_taken():
    plain = np.array([True, False, True, False, False])
    np.testing.assert_array_equal(best_of_each(plain, lambda kind: kind[-1:]), [2, 4])
    np.testing.assert_array_equal(best_of_each(plain[:1], lambda kind: kind), [0])
