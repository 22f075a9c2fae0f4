"""Masks that are taken together and apart, with real trials on painted things."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from click.testing import CliRunner
from regroup_scene import PLACES, STRANGE_ID, taken_for
from scipy.ndimage import binary_dilation

from brrp_cli import Reconstructor
from brrp_cli.api import reconstruct, try_masks
from brrp_cli.cli import main
from brrp_cli.config.mending import RegroupConfig
from brrp_cli.config.registration import TrialConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import BrrpError
from brrp_cli.frames.npz import load_frame, save_frame
from brrp_cli.mending.again import Again
from brrp_cli.mending.chosen import chosen
from brrp_cli.mending.mend import mend
from brrp_cli.mending.regroup import regroup
from brrp_cli.mending.tries import Found, Tries
from brrp_cli.reconstruction import TOO_FEW_POINTS, Similar
from brrp_cli.retrieval.base import one_image
from brrp_cli.segmentation.other_masks import OtherMask

# The can and the ball share a mask, the box comes in two, the plate was left out.
BOX, OTHER_HALF, BOTH = 1, 2, 3
ASIDE = 9


@pytest.fixture
def options(prior, config_file):
    """The same for the command."""
    return ["--prior", prior.path, "--config", config_file, "--retriever", "appearance"]


@pytest.fixture
def begun(given):
    """A new session, with what else is told it."""
    return partial(Reconstructor, **{**given, "retriever": "appearance"})


@pytest.fixture(scope="module")
def frame(truth):
    columns = np.broadcast_to(np.arange(truth.shape[1]), truth.shape)
    box = truth.segmap == 1
    right = box & (columns > np.median(columns[box]))
    segmap = np.select(
        [right, truth.segmap == 2, truth.segmap == 4], [OTHER_HALF, BOTH, 0], truth.segmap
    )
    return replace(truth, segmap=segmap)


@pytest.fixture(scope="module")
def aside(truth):
    return np.where(truth.segmap == 4, ASIDE, 0)


@pytest.fixture(scope="module")
def first(given, frame):
    return reconstruct(frame, **given)


@pytest.fixture(scope="module")
def mended(first, prior, again, aside):
    return mend(first, prior, again, SegmentConfig(), aside)


def each_mask(segmap):
    """Whatever their ids are."""
    return {(segmap == i).tobytes() for i in np.unique(segmap) if i}


def test_each_thing_has_a_mask_of_its_own_in_the_end(mended, truth):
    found = taken_for(mended)
    assert sorted(found.values()) == ["green_plate", "red_box", "red_can", "yellow_ball"]
    names = {**dict(enumerate(PLACES, start=1)), 4: "green_plate"}
    for true_id, name in names.items():
        (object_id,) = (i for i, taken in found.items() if taken == name)
        mine, mask = mended.frame.segmap == object_id, truth.segmap == true_id
        assert (mine & mask).sum() > 0.9 * (mine | mask).sum(), name


def test_what_is_regrouped_has_a_mesh_and_what_stayed_is_what_it_was(first, mended):
    assert all(item.surface is not None for item in mended.objects)
    kept = {item.object_id: item for item in first.objects}
    (stranger,) = (item for item in mended.objects if item.object_id == STRANGE_ID)
    assert stranger is kept[STRANGE_ID] and stranger.recognised is None


@pytest.fixture(scope="module")
def mixed(given, truth):
    """The rest of the box shares a mask with the can: neither mask, nor both, is of one thing."""
    box, columns = truth.segmap == 1, np.broadcast_to(np.arange(truth.shape[1]), truth.shape)
    rest = box & (columns > np.quantile(columns[box], 0.6))
    segmap = np.select([rest | (truth.segmap == 2), box], [BOTH, BOX], 0)
    return reconstruct(truth.with_masks(segmap), **given)


def test_an_object_whose_parts_lie_in_two_masks_is_found_by_what_it_explains(
    mixed, truth, prior, again
):
    result = mend(mixed, prior, again, SegmentConfig())
    found = {taken: i for i, taken in taken_for(result).items()}
    for true_id, name in ((1, "red_box"), (2, "red_can")):
        mine, mask = result.frame.segmap == found[name], truth.segmap == true_id
        assert (mine & mask).sum() > 0.9 * (mine | mask).sum(), name


def test_a_mask_that_is_not_asked_about_does_not_grow(mixed, prior, again):
    assert taken_for(mixed)[BOX] == "red_box"
    result = regroup(mixed, prior, again, SegmentConfig(), None, [BOTH])
    before, now = (each.frame.segmap == BOX for each in (mixed, result))
    assert (before == now).all()


def test_a_rim_around_what_is_cut_stays_with_it(given, truth, prior, again):
    both = np.isin(truth.segmap, [2, 3])
    rimmed = truth.with_masks(np.where(binary_dilation(both, iterations=2), BOTH, 0))
    few = SegmentConfig(regroup=replace(RegroupConfig(), least_pixels=40))
    result = regroup(reconstruct(rimmed, **given), prior, again, few)
    assert set(taken_for(result).values()) == {"red_can", "yellow_ball"}
    assert len(result.objects) == 2
    assert ((result.frame.segmap > 0) == (rimmed.segmap > 0)).all()


def test_two_halves_need_less_weight_than_one_part(first, prior, again, frame, truth):
    tries = Tries(first, prior, again, SegmentConfig())
    own = tries.config.regroup

    def half(true_id, weight):
        mask = (frame.segmap == BOTH) & (truth.segmap == true_id)
        return Found(OtherMask(mask, frozenset([BOTH]), cut=True), weight, mask)

    likely = [half(2, own.half), half(3, own.half)]
    assert {id(each) for each in chosen(likely, tries)} == {id(each.mask) for each in likely}
    assert chosen(likely[:1], tries) == []
    assert chosen([half(2, 0.9 * own.half), half(3, own.half)], tries) == []
    (sure,) = chosen([half(2, own.sure)], tries)
    assert (sure.mask == half(2, 0).mask.mask).all()


def test_a_trial_tells_what_a_reconstruction_does_and_infers_nothing(given, truth):
    masks = [truth.segmap == i for i in (1, 2, 3, STRANGE_ID)]
    bare = replace(truth, segmap=np.zeros_like(truth.segmap))
    tried = try_masks(bare, masks, TrialConfig(), **given)
    assert [item.outcome.name for item in tried] == [*PLACES, None]
    assert [item.object_id for item in tried] == [0, 1, 2, 3]
    assert all(item.surface is None and item.posterior is None for item in tried)


def test_tries_do_not_depend_on_those_before_them(given, first, frame):
    """Not on how many there are at a time, either: what one leaves is what the next one tries."""
    rows = np.nonzero(frame.segmap == BOTH)[0]
    lower = np.arange(frame.shape[0])[:, None] > np.median(rows)
    low = (frame.segmap == BOTH) & lower
    masks = [low, (frame.segmap == BOTH) & ~lower, np.isin(frame.segmap, [BOX, OTHER_HALF])]

    def told(order, workers):
        with one_image(given["retriever"]):
            reconstruct(frame, only=[STRANGE_ID], **given)
            tried = [masks[i] for i in order]
            found = try_masks(frame, tried, TrialConfig(), **{**given, "workers": workers})
        return {
            i: (each.unknown_probability, each.unknown_weight)
            for i, each in zip(order, found, strict=True)
        }

    alone = told([0, 1, 2], 1)
    assert len({repr(each) for each in alone.values()}) == 3
    assert told([2, 1, 0], 1) == alone and told([0, 1, 2], 2) == alone


def test_a_mask_without_depth_and_a_method_without_weights_are_told(given, truth):
    nothing = np.zeros(truth.shape, np.bool_)
    (item,) = try_masks(truth, [nothing], TrialConfig(), **given)
    assert item.status == TOO_FEW_POINTS and item.recognised is None
    with pytest.raises(BrrpError, match="weighs no placements"):
        try_masks(truth, [nothing], TrialConfig(), method="vprism")


def test_nothing_is_tried_where_no_try_is_allowed(first, prior, aside):
    nobody = Again(pytest.fail, pytest.fail)
    for never in (RegroupConfig(rounds=0), RegroupConfig(most=0)):
        assert regroup(first, prior, nobody, SegmentConfig(regroup=never), aside) is first
    unweighed = replace(
        first, objects=[replace(item, unknown_weight=None) for item in first.objects]
    )
    assert regroup(unweighed, prior, nobody, SegmentConfig(), aside) is unweighed


@pytest.mark.parametrize(
    "told",
    [{"similar": [Similar("red_can", 0.9, np.ones(3))]}, {"unknown_weight": 0.1}],
    ids=["stretched", "one stored object or another"],
)
def test_what_is_one_thing_is_not_cut(first, prior, again, told):
    """It may still be a part of something larger."""
    tried = []

    def masks(frame, masks, trial, **known):
        tried.append(masks)
        return again.masks(frame, masks, trial, **known)

    spied = Again(again.objects, masks)
    like = [replace(item, **told) if item.object_id == BOTH else item for item in first.objects]
    regroup(first, prior, spied, SegmentConfig(), None, [BOTH])
    regroup(replace(first, objects=like), prior, spied, SegmentConfig(), None, [BOTH])
    assert len(tried) == 1 and tried[0]


def test_only_masks_that_are_asked_about_are_tried(first, prior, again, frame):
    tried = []

    def masks(frame, masks, trial, **known):
        tried.extend(masks)
        return again.masks(frame, masks, trial, **known)

    spied = Again(pytest.fail, masks)
    assert regroup(first, prior, spied, SegmentConfig(), None, [STRANGE_ID]) is first
    assert not any((mask & (frame.segmap != STRANGE_ID)).any() for mask in tried)


def test_a_session_regroups_the_masks_that_it_makes(begun, truth):
    """The same image without masks, by the same path as a user's."""
    again = begun()
    frame = replace(truth, segmap=np.zeros_like(truth.segmap))
    result = again(frame)
    assert {"red_box", "red_can", "yellow_ball"} <= set(taken_for(result).values())
    assert taken_for(again(frame)) == taken_for(result)


def test_masks_that_were_made_before_are_mended_by_session_and_command(
    begun, options, frame, aside, mended, tmp_path
):
    made, kept = frame.with_masks(frame.segmap, aside), frame
    session = begun()
    assert np.array_equal(session(made).frame.segmap, mended.frame.segmap)
    assert np.array_equal(session(kept).frame.segmap, frame.segmap)
    for name, each, after in (("made", made, mended.frame), ("kept", kept, frame)):
        save_frame(each, tmp_path / f"{name}.npz")
        run = ["reconstruct", tmp_path / f"{name}.npz", *options, "-o", tmp_path / name]
        result = CliRunner().invoke(main, list(map(str, run)))
        assert result.exit_code == 0, result.output
        stored = load_frame(tmp_path / name / "frame.npz")
        assert np.array_equal(stored.segmap, after.segmap), name
        assert stored.aside is None, "what was mended is given from then on"
        assert (tmp_path / f"{name}.masks.png").exists() == (name == "made")


def test_what_was_corrected_stays_and_the_rest_is_mended(begun, frame, aside):
    session = begun()
    result = session(frame.with_masks(frame.segmap, aside, frozenset({BOTH})))
    assert np.array_equal(result.frame.segmap == BOTH, frame.segmap == BOTH)
    others = {taken for i, taken in taken_for(result).items() if i != BOTH}
    assert others == {"green_plate", "red_box"}
    result = session(frame.with_masks(frame.segmap, aside, frozenset({BOX, OTHER_HALF})))
    for half in (BOX, OTHER_HALF):
        assert np.array_equal(result.frame.segmap == half, frame.segmap == half)
    assert {"green_plate", "red_can", "yellow_ball"} <= set(taken_for(result).values())


def test_a_mask_that_was_dropped_stays_away_and_the_rest_is_mended(
    options, frame, aside, mended, tmp_path
):
    save_frame(frame.with_masks(frame.segmap, aside), tmp_path / "made.npz")
    drop = [tmp_path / "made.npz", "--drop", STRANGE_ID, "-o", tmp_path / "fixed.npz"]
    fixed = [tmp_path / "fixed.npz", *options, "-o", tmp_path / "out"]
    for run in (["segment", *drop], ["reconstruct", *fixed]):
        result = CliRunner().invoke(main, list(map(str, run)))
        assert result.exit_code == 0, result.output
    expected = mended.frame.segmap
    found = load_frame(tmp_path / "out" / "frame.npz").segmap
    assert each_mask(found) == each_mask(np.where(expected == STRANGE_ID, 0, expected))


def test_a_stream_mends_what_was_not_corrected_under_the_ids_of_its_tracks(begun, frame, aside):
    session = begun(track=True)
    session(frame.with_masks(np.where(frame.segmap == BOTH, 7, 0)))
    result = session(frame.with_masks(frame.segmap, aside, frozenset({BOTH})))
    assert np.array_equal(result.frame.segmap == 7, frame.segmap == BOTH)
    assert {"green_plate", "red_box"} <= set(taken_for(result).values())


@pytest.fixture
def tried(monkeypatch):
    """How many masks were tried, call by call."""
    numbers = []

    def counted(frame, masks, *args, **kwargs):
        numbers.append(len(masks))
        return try_masks(frame, masks, *args, **kwargs)

    monkeypatch.setattr("brrp_cli.session.try_masks", counted)
    return numbers


def test_what_was_mended_keeps_its_id_and_is_not_tried_again(begun, frame, aside, tried):
    made = frame.with_masks(frame.segmap, aside)
    with begun(track=True) as session:
        first = session(made)
        assert tried
        tried.clear()
        second = session(made)
    assert not tried
    assert np.array_equal(first.frame.segmap, second.frame.segmap)
    assert taken_for(first) == taken_for(second)
    posteriors = {item.object_id: item.posterior for item in first.objects}
    assert all(item.posterior is posteriors[item.object_id] for item in second.objects)


def test_a_camera_that_hardly_moves_looks_into_no_mask_twice(begun, frame, aside, tried):
    nearer = np.eye(4)
    nearer[2, 3] = 0.01
    made = frame.with_masks(frame.segmap, aside)
    here = replace(made, T_world_cam=np.eye(4))
    there = replace(made, T_world_cam=nearer, points=(made.points - [0, 0, 0.01]).astype("f4"))
    with begun(track=True) as session:
        first = session(here)
        tried.clear()
        second = session(there)
    assert sum(tried) <= 1, "but for the stranger, which was left out"
    assert taken_for(first) == taken_for(second)
