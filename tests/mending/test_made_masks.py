"""What is recognised in a small mask that brrp made is more in doubt than in one that was given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli import load_config
from brrp_cli.api import reconstruct, try_masks
from brrp_cli.config.mending import MendConfig, RegroupConfig
from brrp_cli.config.registration import TrialConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.retrieval.appearance import AppearanceRetriever
from brrp_cli.session import Reconstructor

DOUBT = 2.0


@pytest.fixture(scope="module")
def frame(truth):
    return truth


@pytest.fixture(scope="module")
def setup(prior, config_file, frame):
    """Of the frame's masks half count as small."""
    config = load_config(config_file)
    counts = [(frame.segmap == i).sum() for i in frame.object_ids]
    weigh = replace(config.hypotheses.weigh, small=int(np.median(counts)), doubt=DOUBT)
    config = replace(config, hypotheses=replace(config.hypotheses, weigh=weigh))
    retriever = AppearanceRetriever(prior, config, 0)
    return {"prior": prior, "config": config, "retriever": retriever, "workers": 1}


def odds_of_none(result):
    """Log odds that an object is none of the stored ones, by id, where that is not sure."""
    weights = {each.object_id: each.unknown_weight for each in result.objects}
    return {i: np.log(w / (1 - w)) for i, w in weights.items() if w < 0.9999}


@pytest.fixture(scope="module")
def plain(frame, setup):
    return odds_of_none(reconstruct(frame, **setup))


def doubts(frame, setup, ids):
    small = setup["config"].hypotheses.weigh.small
    counts = {i: (frame.segmap == i).sum() for i in ids}
    found = {i: max(0.0, DOUBT * np.log(small / n)) for i, n in counts.items()}
    assert 0 < sum(each > 0 for each in found.values()) < len(found)
    return found


def smallest(frame, ids):
    return min(ids, key=lambda i: (frame.segmap == i).sum())


def test_small_masks_are_doubted_by_their_size(frame, setup, plain):
    made = odds_of_none(reconstruct(frame, given=(), **setup))
    for object_id, doubt in doubts(frame, setup, plain).items():
        assert made[object_id] - plain[object_id] == pytest.approx(doubt, abs=1e-3)


def test_those_that_were_given_are_not(frame, setup, plain):
    assert odds_of_none(reconstruct(frame, given=frame.object_ids, **setup)) == plain
    given = smallest(frame, plain)
    found = odds_of_none(reconstruct(frame, given=[given], **setup))
    assert found[given] == plain[given]


def test_a_session_tells_which_masks_it_made(frame, setup, plain):
    unmended = replace(
        SegmentConfig(),
        mend=replace(MendConfig(), rounds=0),
        regroup=replace(RegroupConfig(), rounds=0),
    )
    with Reconstructor(**setup, segmentation=unmended, helpers=0) as session:
        assert odds_of_none(session(frame)) == plain
        # As the command does that makes masks: nothing was left out.
        made = replace(frame, aside=np.zeros_like(frame.segmap))
        found = odds_of_none(session(made))
    assert found == odds_of_none(reconstruct(frame, given=(), **setup))


def test_masks_that_are_tried_were_made(frame, setup, plain):
    masks = [frame.segmap == i for i in frame.object_ids]
    tried = try_masks(frame, masks, TrialConfig(), **setup)
    small = smallest(frame, plain)
    weight = tried[frame.object_ids.index(small)].unknown_weight
    assert np.log(weight / (1 - weight)) > plain[small] + 0.1
