"""Stored objects laid over what is seen: which lie well, and how many are tried."""

import dataclasses

import numpy as np
import pytest
from painted_retrieval import ONE_BY_ONE, STRANGER, retriever_of, scene

from brrp_cli.config import preset
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.retrieval.aligned import seen_part
from brrp_cli.retrieval.appearance import AppearanceRetriever
from brrp_cli.retrieval.base import hasty, one_image
from brrp_cli.retrieval.held_models import HeldModels


def test_what_is_seen_lies_on_the_true_object_alone(prior, retriever):
    frame, names = scene()
    for object_id, look in retriever.evidence(frame).items():
        score = dict(zip([prior.names[row] for row in look.rows], look.alignment, strict=True))
        if object_id == STRANGER:
            assert max(score.values()) < 0.7
            continue
        name = names[object_id]
        same = {"red_box", "blue_box"} if name.endswith("_box") else {name}
        assert score[name] > 0.85
        assert max(v for other, v in score.items() if other not in same) < score[name] - 0.15


def test_the_true_object_alone_fills_its_mask_and_no_more(prior, retriever):
    frame, names = scene()
    others = []
    for object_id, look in retriever.evidence(frame).items():
        if object_id == STRANGER:
            continue
        own = look.rows.tolist().index(prior.names.index(names[object_id]))
        assert look.bare[own] < 0.03 and look.spilled[own] < 0.03
        # Of those that were placed.
        placed = (look.alignment > 0.3) & (np.arange(len(look.rows)) != own)
        others += (look.bare + look.spilled)[placed].tolist()
    assert len(others) > 0 and np.median(others) > 0.1


def test_silhouettes_choose_among_the_placements_of_an_object(prior):
    """Where they speak for a placement, where against it, and where they are not asked."""
    config = preset("default")
    own = config.retrieval.alignment
    frame, names = scene()
    plane = scene_plane(frame, config.observation, 0)
    models = HeldModels(prior, own)

    def off(object_id, worth):
        """What the placements that are kept leave bare and cover beside the mask, in all."""
        points = np.random.default_rng(0).permutation(frame.object_points(object_id))
        seen = seen_part(
            points,
            frame,
            object_id,
            plane,
            0.0,
            models,
            own,
            lambda bare, spilled: worth * (bare + spilled),
        )
        seen.first_scores(prior.names)
        seen.scores(prior.names)
        seen.last_scores(prior.names)
        return seen.silhouettes(prior.names).sum()

    against, unasked, wished = (sum(off(i, worth) for i in names) for worth in (100.0, 0.0, -100.0))
    assert against < unasked < wished


def test_more_objects_are_tried_until_one_lies_well(prior):
    frame, names = scene()

    def aligned(**numbers):
        retriever = retriever_of(prior, margin=100.0, unaligned=0.1, **numbers)
        found = retriever.evidence(frame)
        return {i: int((found[i].alignment > 0.1).sum()) for i in (*names, STRANGER)}

    assert set(aligned(tried=(1,), glanced=()).values()) == {1}
    # The stranger lies well on nothing, so that all are tried; the others end with their own.
    until = aligned(tried=(1,), least=1, glanced=(0.0,) * 4, certain=6.0, at_once=6.0)
    assert until[STRANGER] > max(until[i] for i in names) == 1
    assert min(aligned(tried=(2,), glanced=(), certain=0.0, at_once=0.0).values()) > 1


def test_in_haste_the_first_round_is_all(prior):
    frame, names = scene()
    numbers = ONE_BY_ONE | {"tried": (1, 2), "distinct": 1.0}
    retriever = retriever_of(prior, worth=10_000.0, **numbers)

    def tried(object_id):
        return int((retriever.evidence(frame, [object_id])[object_id].alignment > 0.1).sum())

    plain = int(np.sum(~prior.appearance.first.colour.any(axis=1)))
    with hasty(retriever):
        assert {tried(i) for i in names} == {(plain > 0) + 1}
    assert max(tried(i) for i in names) > (plain > 0) + 1


def test_after_a_glance_a_share_of_the_prior_is_tried(prior):
    """Of those with colours and of those without; never fewer than `least` of either."""
    frame, names = scene()

    def tried(share, least):
        numbers = ONE_BY_ONE | {"glanced": (share,), "least": least, "distinct": 1.0}
        found = retriever_of(prior, worth=10_000.0, **numbers).evidence(frame)
        return max(int((found[i].alignment > 0.1).sum()) for i in names)

    plain = int(np.sum(~prior.appearance.first.colour.any(axis=1)))
    first = (plain > 0) + 1
    count = len(prior.names)
    assert tried(0.0, 1) == 2 * first
    assert tried(1.0, 1) == count
    assert tried(0.0, count) == count


def test_rounds_end_where_none_of_those_left_could_become_the_most_probable(prior):
    frame, names = scene()

    def aligned(worth):
        retriever = retriever_of(prior, worth=worth, **ONE_BY_ONE)
        found = retriever.evidence(frame)
        return {i: int((found[i].alignment > 0.1).sum()) for i in names}

    # The more alignment scores weigh beside looks, the longer the others have a chance; but
    # not beside what lies perfectly, as one of the things does.
    few, many = aligned(0.1), aligned(10_000.0)
    assert set(few.values()) == {1}
    assert sum(tried > 1 for tried in many.values()) >= len(names) - 1


def test_at_a_glance_the_true_object_lies_best(prior):
    config = preset("default")
    frame, names = scene()
    plane = scene_plane(frame, config.observation, 0)
    own = config.retrieval.alignment
    models = HeldModels(prior, own)
    for object_id, name in names.items():
        points = np.random.default_rng(0).permutation(frame.object_points(object_id))
        seen = seen_part(
            points, frame, object_id, plane, 0.0, models, own, lambda bare, spilled: 0 * bare
        )
        best = prior.names[int(seen.glances(prior.names).argmax())]
        assert best == name or {best, name} == {"red_box", "blue_box"}


def test_what_looks_do_not_find_a_glance_finds(prior):
    """Where all look alike, one of them is tried first, and then the one that lies best."""
    frame, names = scene()
    config = preset("default")
    blind = {"colour": 0.0, "pairs": 0.0, "size": 0.0}
    own = config.retrieval

    def found(**numbers):
        alignment = dataclasses.replace(
            own.alignment,
            tried=(1,),
            least=1,
            certain=0.0,
            at_once=0.0,
            **numbers,
        )
        retrieval = dataclasses.replace(
            own,
            alignment=alignment,
            likeness=dataclasses.replace(own.likeness, **blind),
            steering=dataclasses.replace(own.steering, **blind),
            fusion=dataclasses.replace(own.fusion, **blind),
        )
        retriever = AppearanceRetriever(prior, dataclasses.replace(config, retrieval=retrieval), 0)
        best = {i: prior.names[retriever.probabilities(frame, i).argmax()] for i in names}
        boxes = {"red_box", "blue_box"}
        return {i for i, name in best.items() if name == names[i] or {name, names[i]} == boxes}

    assert found(glanced=(0.0,)) == set(names) > found(glanced=())


@pytest.mark.parametrize("kept", [0.0, 0.2])
def test_where_depth_shows_nothing_or_little_the_mask_tells(prior, retriever, kept):
    """Without colours, so that only the silhouette is left."""
    frame, names = scene()
    grey = np.full_like(frame.rgb, 127)
    lost = np.random.default_rng(0).random(frame.shape) >= kept
    for object_id, name in names.items():
        points = frame.points.copy()
        points[(frame.segmap == object_id) & lost] = np.nan
        blind = dataclasses.replace(frame, points=points, rgb=grey)
        look = retriever.evidence(blind)[object_id]
        assert (look.points == 0) == (kept == 0)
        own = look.rows.tolist().index(prior.names.index(name))
        assert look.bare[own] < 0.1 and look.spilled[own] < 0.1
        odd = look.bare + look.spilled
        best = prior.names[look.rows[odd.argmin()]]
        assert best == name or {best, name} == {"red_box", "blue_box"} or odd[own] < 0.03


def test_in_haste_fewer_objects_are_tried_and_what_is_known_is_used(prior):
    frame, _ = scene()
    retriever = retriever_of(prior, worth=10_000.0, **ONE_BY_ONE)

    def tried():
        return int((retriever.evidence(frame)[STRANGER].alignment > 0.1).sum())

    with hasty(retriever):
        assert tried() == 1
    with one_image(retriever):
        with hasty(retriever):
            assert tried() == 1
        every = tried()
        assert every > 1
        with hasty(retriever):
            assert tried() == every


def test_without_a_plane_nothing_is_aligned(retriever):
    frame, _ = scene()
    floating = np.where((frame.segmap == 0)[..., None], np.nan, frame.points)
    bare = dataclasses.replace(frame, points=floating.astype(np.float32))
    config = preset("default")
    neutral = config.retrieval.alignment.neutral
    assert scene_plane(bare, config.observation, 0) is None
    assert all(np.all(look.alignment == neutral) for look in retriever.evidence(bare).values())
