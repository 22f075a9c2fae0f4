"""Masks that are taken together and apart, with real trials on painted things."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from painted_scene import STRANGE, THINGS, photograph, write_things

from brrp_cli import Reconstructor
from brrp_cli.api import reconstruct
from brrp_cli.config.registration import TrialConfig
from brrp_cli.config.segmentation import RegroupConfig, SegmentConfig
from brrp_cli.mending.mend import mend
from brrp_cli.mending.regroup import regroup
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import BuildParameters
from brrp_cli.prior.store import open_prior

# The can and the ball share a mask, the box comes in two, the plate was left out.
PLACES = {"red_box": (-0.16, 0.06), "red_can": (0.1, 0.08), "yellow_ball": (0.1, -0.05)}
PLATE, STRANGER = (-0.1, -0.18), (0.24, 0.12)
BOX, OTHER_HALF, BOTH, STRANGE_ID = 1, 2, 3, 5
ASIDE = 9


@pytest.fixture(scope="module")
def prior(tmp_path_factory):
    folder = tmp_path_factory.mktemp("painted")
    parameters = BuildParameters(samples=400, surface_points=400, dense_points=4_000)
    build_prior(write_things(folder / "meshes"), folder / "prior", parameters, workers=1)
    return open_prior(folder / "prior")


@pytest.fixture(scope="module")
def truth():
    things = {i: (*THINGS[name], *PLACES[name]) for i, name in enumerate(PLACES, start=1)}
    things[4] = (*THINGS["green_plate"], *PLATE)
    return photograph(things | {STRANGE_ID: (*STRANGE, *STRANGER)})


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
def run(prior):
    return partial(reconstruct, prior=prior, retriever="appearance", workers=1)


@pytest.fixture(scope="module")
def first(run, frame):
    return run(frame)


@pytest.fixture(scope="module")
def mended(first, prior, run, aside):
    def again(frame, only, /, *, trial=None):
        return run(frame, only=only, trial=trial)

    return mend(first, prior, again, SegmentConfig(), aside)


def taken_for(result):
    return {item.object_id: item.outcome.name for item in result.objects if item.recognised}


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


def test_a_trial_tells_what_a_reconstruction_does_and_infers_nothing(run, truth):
    frame = replace(truth, segmap=np.where(truth.segmap < 4, truth.segmap, 0))
    whole, tried = run(frame), run(frame, trial=TrialConfig())
    assert taken_for(tried) == taken_for(whole) and len(taken_for(tried)) == 3
    assert all(item.surface is None and item.posterior is None for item in tried.objects)


def test_nothing_is_tried_where_no_try_is_allowed(first, prior, aside):
    never = SegmentConfig(regroup=RegroupConfig(most=0))
    assert regroup(first, prior, pytest.fail, never, aside) is first
    nobody = [replace(item, unknown_weight=None) for item in first.objects]
    unweighed = replace(first, objects=nobody)
    assert regroup(unweighed, prior, pytest.fail, SegmentConfig(), aside) is unweighed


def test_only_masks_that_are_asked_about_are_tried(first, prior, run):
    tried = []

    def again(frame, only, /, *, trial=None):
        tried.extend(only)
        return run(frame, only=only, trial=trial)

    assert regroup(first, prior, again, SegmentConfig(), None, [STRANGE_ID]) is first
    assert not tried


def test_a_session_regroups_the_masks_that_it_makes(prior, truth):
    """The same image without masks, by the same path as a user's."""
    again = Reconstructor(prior, retriever="appearance", workers=1)
    frame = replace(truth, segmap=np.zeros_like(truth.segmap))
    result = again(frame)
    assert {"red_box", "red_can", "yellow_ball"} <= set(taken_for(result).values())
    assert taken_for(again(frame)) == taken_for(result)
