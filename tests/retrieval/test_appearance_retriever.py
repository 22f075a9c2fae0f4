import dataclasses
import shutil

import numpy as np
import pytest
from painted_scene import STRANGE, THINGS, photograph, write_things

from brrp_cli.config import FeatureConfig, preset
from brrp_cli.errors import RetrievalError
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.observation.strays import without_strays
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.by_name import from_bytes, to_bytes
from brrp_cli.prior.parameters import BuildParameters
from brrp_cli.prior.store import open_prior
from brrp_cli.registration.model import search_model
from brrp_cli.retrieval import steps
from brrp_cli.retrieval.aligned import seen_part
from brrp_cli.retrieval.appearance import AppearanceRetriever
from brrp_cli.retrieval.base import hasty, helped, one_image, sendable, unknown
from brrp_cli.retrieval.held_models import PARTS, HeldModels, bare_model

PLACES = {3: (-0.15, 0.1), 4: (0.12, 0.14), 8: (0.0, -0.02), 9: (0.2, -0.1), 11: (-0.2, -0.14)}
STRANGER = 20
# Rounds of one object each, none of which ends them.
ONE_BY_ONE = {
    "tried": (1,),
    "glanced": (0.0,) * 4,
    "least": 1,
    "margin": 100.0,
    "unaligned": 0.1,
    "certain": 0.0,
    "at_once": 0.0,
}


@pytest.fixture(scope="module")
def prior(tmp_path_factory):
    folder = tmp_path_factory.mktemp("painted")
    parameters = BuildParameters(
        samples=400,
        surface_points=200,
        dense_points=2_000,
        features=FeatureConfig(scales=(1.0,)),
    )
    build_prior(write_things(folder / "meshes"), folder / "prior", parameters, workers=1)
    return open_prior(folder / "prior")


@pytest.fixture(params=["aligned", "by looks alone"])
def retriever(prior, request):
    return retriever_of(prior, request.param == "aligned")


@pytest.fixture
def aligner(prior):
    return retriever_of(prior, True)


def retriever_of(prior, aligned, name="default", worth=None, **numbers):
    """Of a small prior, whose objects are aligned only where that is asked for; worth : nats of an
    alignment score of 1."""
    config = preset(name)
    if aligned:
        alignment = dataclasses.replace(config.retrieval.alignment, from_objects=1, **numbers)
        fusion = config.retrieval.fusion
        if worth is not None:
            fusion = dataclasses.replace(fusion, alignment=worth)
        own = dataclasses.replace(config.retrieval, alignment=alignment, fusion=fusion)
        config = dataclasses.replace(config, retrieval=own)
    return AppearanceRetriever(prior, config, 0)


def scene(light=(1.0, 1.0, 1.0)):
    names = dict(zip(PLACES, THINGS, strict=True))
    placed = {i: (*THINGS[name], *PLACES[i]) for i, name in names.items()}
    return photograph(placed | {STRANGER: (*STRANGE, 0.0, 0.2)}, light), names


def test_the_prior_says_which_meshes_have_colours(prior):
    assert all(entry.record["coloured"] for entry in prior.manifest.objects)


@pytest.mark.parametrize("light", [(1, 1, 1), (0.75, 0.65, 0.5), (1.1, 1.2, 1.3)])
def test_the_true_object_is_first_in_any_light(prior, retriever, light):
    frame, names = scene(light)
    for object_id, name in names.items():
        probabilities = retriever.probabilities(frame, object_id)
        assert probabilities.shape == (5,) and (probabilities >= 0).all()
        assert probabilities.sum() <= 1 + 1e-9
        assert prior.names[int(probabilities.argmax())] == name
        assert unknown(probabilities) < 0.5


def test_the_papers_preset_aligns_as_the_default_does(prior, aligner):
    frame, names = scene()
    paper = retriever_of(prior, True, "paper")
    for object_id in names:
        np.testing.assert_allclose(
            paper.probabilities(frame, object_id), aligner.probabilities(frame, object_id)
        )


def test_of_one_image_what_was_seen_of_a_mask_counts_again(retriever, monkeypatch):
    frame, names = scene()
    joined = dataclasses.replace(frame, segmap=np.where(frame.segmap == 4, 3, frame.segmap))
    fresh = retriever.evidence(frame)
    seen = []
    look = steps.see_object
    monkeypatch.setattr(steps, "see_object", lambda *args: seen.append(args[1]) or look(*args))
    with one_image(retriever):
        assert retriever.evidence(frame).keys() == fresh.keys()
        again = retriever.evidence(joined)
        assert seen == [*frame.object_ids, 3]
        for object_id in set(names) - {3, 4}:
            np.testing.assert_array_equal(again[object_id].pairs, fresh[object_id].pairs)
    retriever.evidence(joined)
    assert len(seen) == len(frame.object_ids) + 1 + len(joined.object_ids)


def test_whoever_does_the_steps_the_answer_is_the_same(prior, retriever):
    """Each step is sent by its name, as to another process."""
    frame, _ = scene()
    expected = retriever.evidence(frame)
    asked = []

    def elsewhere(do, common, args):
        asked.append((do.__name__, len(args)))
        image = from_bytes(to_bytes(common, prior), prior)
        return [do(image, *from_bytes(to_bytes(one, prior), prior)) for one in args]

    with helped(retriever, elsewhere):
        found = retriever.evidence(dataclasses.replace(frame))
    count = len(frame.object_ids)
    assert asked == [("looked", count), ("aligned", count)][: 1 + retriever.aligns]
    same(found, expected)
    asked.clear()
    retriever.evidence(frame)
    assert not asked


def test_a_copy_elsewhere_answers_alike_and_knows_what_was_seen(prior, retriever, monkeypatch):
    frame, _ = scene()
    assert sendable(retriever)
    with one_image(retriever), hasty(retriever):
        expected = retriever.probabilities(frame, 4)
    with one_image(retriever):
        retriever.evidence(frame)
        with hasty(retriever):
            known = retriever.probabilities(frame, 4)
            sent = to_bytes(retriever, prior)
    copy = from_bytes(sent, prior)
    monkeypatch.setattr(steps, "see_object", None)
    np.testing.assert_array_equal(copy.probabilities(frame, 4), known)
    monkeypatch.undo()
    fresh = from_bytes(to_bytes(retriever_like(prior, retriever), prior), prior)
    with hasty(fresh):
        np.testing.assert_array_equal(fresh.probabilities(frame, 4), expected)


def same(found, expected):
    """The same evidence, number by number."""
    assert found.keys() == expected.keys()
    for object_id, look in expected.items():
        for field in dataclasses.fields(look):
            np.testing.assert_array_equal(
                getattr(found[object_id], field.name), getattr(look, field.name)
            )


def retriever_like(prior, retriever):
    """Another, which has seen nothing."""
    return retriever_of(prior, retriever.aligns)


def test_a_stranger_is_told(retriever):
    frame, _ = scene()
    assert unknown(retriever.probabilities(frame, STRANGER)) > 0.8


def test_without_colours_shape_and_size_are_left(prior, retriever):
    frame, names = scene()
    grey = dataclasses.replace(frame, rgb=np.full_like(frame.rgb, 127))
    found = {i: retriever.probabilities(grey, i) for i in names}
    for object_id, name in names.items():
        ranked = [prior.names[k] for k in np.argsort(-found[object_id])]
        if name.endswith("_box"):
            assert set(ranked[:2]) == {"red_box", "blue_box"}
        else:
            assert ranked[0] == name


def test_what_is_seen_lies_on_the_true_object_alone(prior, aligner):
    frame, names = scene()
    for object_id, look in aligner.evidence(frame).items():
        score = dict(zip([prior.names[row] for row in look.rows], look.alignment, strict=True))
        if object_id == STRANGER:
            assert max(score.values()) < 0.7
            continue
        name = names[object_id]
        same = {"red_box", "blue_box"} if name.endswith("_box") else {name}
        assert score[name] > 0.85
        assert max(v for other, v in score.items() if other not in same) < score[name] - 0.15


def test_the_true_object_alone_fills_its_mask_and_no_more(prior, aligner):
    frame, names = scene()
    others = []
    for object_id, look in aligner.evidence(frame).items():
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
        aligner = retriever_of(prior, True, margin=100.0, unaligned=0.1, **numbers)
        found = aligner.evidence(frame)
        return {i: int((found[i].alignment > 0.1).sum()) for i in (*names, STRANGER)}

    assert set(aligned(tried=(1,), glanced=()).values()) == {1}
    # The stranger lies well on nothing, so that all are tried; the others end with their own.
    until = aligned(tried=(1,), least=1, glanced=(0.0,) * 4, certain=6.0, at_once=6.0)
    assert until[STRANGER] > max(until[i] for i in names) == 1
    assert min(aligned(tried=(2,), glanced=(), certain=0.0, at_once=0.0).values()) > 1


def test_in_haste_the_first_round_is_all(prior):
    frame, names = scene()
    numbers = ONE_BY_ONE | {"tried": (1, 2), "distinct": 1.0}
    retriever = retriever_of(prior, True, worth=10_000.0, **numbers)

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
        found = retriever_of(prior, True, worth=10_000.0, **numbers).evidence(frame)
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
        aligner = retriever_of(prior, True, worth=worth, **ONE_BY_ONE)
        found = aligner.evidence(frame)
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


def test_models_that_are_kept_beside_the_prior_are_those_of_the_shards(prior, tmp_path):
    """A glance at all keeps them, and the next command reads no shard."""
    copied = tmp_path / "prior"
    shutil.copytree(prior.path, copied, ignore=lambda *_: ["parts"])
    own = preset("default").retrieval.alignment
    fresh, names = HeldModels(open_prior(copied), own), prior.names
    read = fresh.of(names)
    glanced_at = fresh.coarse(names)
    shutil.rmtree(copied / "shards")
    kept = HeldModels(open_prior(copied), own)
    found = kept.of(names) + kept.coarse(names)
    for one, other in zip(read + glanced_at, found, strict=True):
        assert one.half_extent == other.half_extent
        for arrays in ((one.field.values, other.field.values), (one.surface, other.surface)):
            assert arrays[0].dtype == arrays[1].dtype
            np.testing.assert_array_equal(*arrays)
        np.testing.assert_array_equal(one.normals, other.normals)
        np.testing.assert_array_equal(one.resting, other.resting)


def test_what_looks_do_not_find_a_glance_finds(prior):
    """Where all look alike, one of them is tried first, and then the one that lies best."""
    frame, names = scene()
    config = preset("default")
    blind = {"colour": 0.0, "pairs": 0.0, "size": 0.0}
    own = config.retrieval

    def found(**numbers):
        alignment = dataclasses.replace(
            own.alignment,
            from_objects=1,
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
            fusion=dataclasses.replace(own.fusion, **blind),
        )
        retriever = AppearanceRetriever(prior, dataclasses.replace(config, retrieval=retrieval), 0)
        best = {i: prior.names[retriever.probabilities(frame, i).argmax()] for i in names}
        boxes = {"red_box", "blue_box"}
        return {i for i, name in best.items() if name == names[i] or {name, names[i]} == boxes}

    assert found(glanced=(0.0,)) == set(names) > found(glanced=())


@pytest.mark.parametrize("kept", [0.0, 0.2])
def test_where_depth_shows_nothing_or_little_the_mask_tells(prior, aligner, kept):
    """Without colours, so that only the silhouette is left."""
    frame, names = scene()
    grey = np.full_like(frame.rgb, 127)
    lost = np.random.default_rng(0).random(frame.shape) >= kept
    for object_id, name in names.items():
        points = frame.points.copy()
        points[(frame.segmap == object_id) & lost] = np.nan
        blind = dataclasses.replace(frame, points=points, rgb=grey)
        look = aligner.evidence(blind)[object_id]
        assert (look.points == 0) == (kept == 0)
        own = look.rows.tolist().index(prior.names.index(name))
        assert look.bare[own] < 0.1 and look.spilled[own] < 0.1
        odd = look.bare + look.spilled
        best = prior.names[look.rows[odd.argmin()]]
        assert best == name or {best, name} == {"red_box", "blue_box"} or odd[own] < 0.03


def test_in_haste_fewer_objects_are_tried_and_what_is_known_is_used(prior):
    frame, _ = scene()
    aligner = retriever_of(prior, True, worth=10_000.0, **ONE_BY_ONE)

    def tried():
        return int((aligner.evidence(frame)[STRANGER].alignment > 0.1).sum())

    with hasty(aligner):
        assert tried() == 1
    with one_image(aligner):
        with hasty(aligner):
            assert tried() == 1
        every = tried()
        assert every > 1
        with hasty(aligner):
            assert tried() == every


def test_colours_that_say_nothing_leave_it_to_alignment(prior, aligner):
    """Half of a box is hidden: its size is too small, and it still lies on the stored box."""
    frame, names = scene()
    segmap = frame.segmap.copy()
    rows, columns = np.nonzero(segmap == 3)
    cut = columns > np.median(columns)
    segmap[rows[cut], columns[cut]] = 0
    grey = dataclasses.replace(frame, segmap=segmap, rgb=np.full_like(frame.rgb, 127))
    probabilities = aligner.probabilities(grey, 3)
    best = [prior.names[k] for k in np.argsort(-probabilities)[:2]]
    assert set(best) == {"red_box", "blue_box"} and names[3] in best


def test_without_a_plane_nothing_is_aligned(aligner):
    frame, _ = scene()
    floating = np.where((frame.segmap == 0)[..., None], np.nan, frame.points)
    bare = dataclasses.replace(frame, points=floating.astype(np.float32))
    config = preset("default")
    neutral = config.retrieval.alignment.neutral
    assert scene_plane(bare, config.observation, 0) is None
    assert all(np.all(look.alignment == neutral) for look in aligner.evidence(bare).values())


def test_a_model_that_is_read_alone_is_that_of_the_object(prior):
    ((_, arrays),) = prior.parts(["red_can"], PARTS)
    whole, alone = search_model(prior.load("red_can")), bare_model(arrays, 150)
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (50, 3))
    np.testing.assert_allclose(alone.signed_distance(points), whole.signed_distance(points))
    np.testing.assert_array_equal(alone.resting, whole.resting)
    np.testing.assert_array_equal(alone.surface, whole.surface[:150])
    np.testing.assert_array_equal(alone.normals, whole.normals[:150])


def test_answers_are_those_of_the_frame_that_is_asked_about(prior, retriever):
    frame, _ = scene()
    first = retriever.probabilities(frame, 3)
    swapped = np.where(frame.segmap == 3, 4, np.where(frame.segmap == 4, 3, frame.segmap))
    other = dataclasses.replace(frame, segmap=swapped)
    np.testing.assert_allclose(retriever.probabilities(other, 4), first)
    np.testing.assert_array_equal(retriever.probabilities(frame, 3), first)


def test_a_pixel_far_behind_its_object_changes_nothing_else(prior, retriever):
    """As methods see the frame that leave such pixels out, and those that do not."""
    frame, _ = scene()
    pixel = tuple(np.argwhere(frame.segmap == 3)[0])
    points = frame.points.copy()
    points[pixel] *= 4.0
    with_stray = dataclasses.replace(frame, points=points)
    without = without_strays(with_stray, preset("default").strays)
    assert without is not with_stray
    # Frame by frame: what is seen of one is kept until another is asked about.
    first, second = (
        [retriever.probabilities(each, object_id) for object_id in frame.object_ids]
        for each in (with_stray, without)
    )
    np.testing.assert_array_equal(second, first)


def test_an_object_that_is_not_there_is_refused(retriever):
    with pytest.raises(RetrievalError, match="no such object"):
        retriever.probabilities(scene()[0], 77)


def test_an_object_of_few_pixels_gets_an_answer(retriever):
    frame, _ = scene()
    segmap = frame.segmap.copy()
    rows, columns = np.nonzero(segmap == 3)
    segmap[rows[4:], columns[4:]] = 0
    few = dataclasses.replace(frame, segmap=segmap)
    probabilities = retriever.probabilities(few, 3)
    assert np.isfinite(probabilities).all() and probabilities.sum() <= 1 + 1e-9


def test_objects_without_any_depth_get_an_answer(retriever):
    frame, _ = scene()
    points = np.where((frame.segmap == 3)[..., None], np.nan, frame.points)
    blind = dataclasses.replace(frame, points=points.astype(np.float32))
    assert np.isfinite(retriever.probabilities(blind, 3)).all()
