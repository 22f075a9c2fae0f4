import dataclasses

import numpy as np
import pytest
from painted_retrieval import STRANGER, retriever_of, scene

from brrp_cli.config import preset
from brrp_cli.errors import RetrievalError
from brrp_cli.observation.strays import without_strays
from brrp_cli.prior.by_name import from_bytes, to_bytes
from brrp_cli.retrieval import steps
from brrp_cli.retrieval.base import hasty, helped, one_image, sendable, unknown


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


def test_the_papers_preset_aligns_as_the_default_does(prior, retriever):
    frame, names = scene()
    paper = retriever_of(prior, "paper")
    for object_id in names:
        np.testing.assert_allclose(
            paper.probabilities(frame, object_id), retriever.probabilities(frame, object_id)
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
    fresh = from_bytes(to_bytes(retriever_of(prior), prior), prior)
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


def test_colours_that_say_nothing_leave_it_to_alignment(prior, retriever):
    """Half of a box is hidden: its size is too small, and it still lies on the stored box."""
    frame, names = scene()
    segmap = frame.segmap.copy()
    rows, columns = np.nonzero(segmap == 3)
    cut = columns > np.median(columns)
    segmap[rows[cut], columns[cut]] = 0
    grey = dataclasses.replace(frame, segmap=segmap, rgb=np.full_like(frame.rgb, 127))
    probabilities = retriever.probabilities(grey, 3)
    best = [prior.names[k] for k in np.argsort(-probabilities)[:2]]
    assert set(best) == {"red_box", "blue_box"} and names[3] in best


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
