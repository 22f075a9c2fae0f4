"""What the image's border cuts, with and without a stored object that tells the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from painted_retrieval import painted_prior, write_coarse
from painted_scene import STRANGE, THINGS, photograph

from brrp_cli import Reconstructor, load_config
from brrp_cli.api import try_masks
from brrp_cli.config.segmentation import LeftOutConfig, SegmentConfig
from brrp_cli.errors import FrameError
from brrp_cli.mending.strangers import of_left_out, without_strangers
from brrp_cli.reconstruction import OK, ObjectReconstruction, Retrieved

WHOLE, CUT, STRANGER = 1, 2, 3
AT_THE_BORDER, BEYOND = (0.34, 0.0), (0.23, -0.3)
# A corner of these small images has fewer pixels than one of a camera's.
SEGMENTATION = SegmentConfig(left_out=replace(LeftOutConfig(), tell=300))


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cut")
    return {
        "prior": painted_prior(folder),
        "config": load_config(write_coarse(folder)),
        "retriever": "appearance",
        "workers": 1,
        "segmentation": SEGMENTATION,
    }


@pytest.fixture(scope="module")
def session(given):
    with Reconstructor(**given) as session:
        yield session


def unmasked(frame):
    return frame.without_masks()


def names(result):
    return [item.outcome.name for item in result.objects]


@pytest.fixture(scope="module")
def scene():
    return photograph(
        {
            WHOLE: (*THINGS["red_box"], -0.1, 0.0),
            CUT: (*THINGS["blue_box"], *AT_THE_BORDER),
            STRANGER: (*STRANGE, *BEYOND),
        }
    )


@pytest.fixture(scope="module")
def first(scene, session):
    return session(unmasked(scene))


def on_the_border(mask):
    inner = mask[1:-1, 1:-1].sum()
    return 0 < inner < mask.sum()


def test_a_stored_object_that_the_border_cuts_is_found_and_a_stranger_is_not(scene, first):
    assert all(on_the_border(scene.segmap == i) for i in (CUT, STRANGER))
    assert sorted(names(first)) == ["blue_box", "red_box"]
    assert sorted(first.frame.object_ids) == [item.object_id for item in first.objects]
    (cut,) = (item for item in first.objects if item.outcome.name == "blue_box")
    mask, true = first.frame.segmap == cut.object_id, scene.segmap == CUT
    assert (mask & true).sum() > 0.8 * (mask | true).sum()
    # The mesh is the whole box, beyond the image, too.
    assert cut.surface is not None
    assert cut.surface.as_trimesh().volume == pytest.approx(0.10 * 0.06 * 0.12, rel=0.1)


def test_where_the_border_cuts_all_there_is_what_is_recognised_alone_is_an_object(session):
    cut = photograph({CUT: (*THINGS["blue_box"], *AT_THE_BORDER)})
    assert names(session(unmasked(cut))) == ["blue_box"]
    with pytest.raises(FrameError, match=r"only what the image's border cuts.*no stored object"):
        session(unmasked(photograph({STRANGER: (*STRANGE, *BEYOND)})))


def test_an_object_that_the_border_cuts_keeps_its_id_and_what_was_made_of_it(
    scene, given, monkeypatch
):
    tried = []

    def counted(frame, masks, *args, **kwargs):
        tried.append(len(masks))
        return try_masks(frame, masks, *args, **kwargs)

    monkeypatch.setattr("brrp_cli.session.try_masks", counted)
    with Reconstructor(**given, track=True) as tracking:
        first = tracking(unmasked(scene))
        assert tried
        tried.clear()
        second = tracking(unmasked(scene))
    assert not tried, "what rests is not tried again, the stranger neither"
    assert len(first.objects) == 2
    assert [i.object_id for i in second.objects] == [i.object_id for i in first.objects]
    assert all(
        new.posterior is old.posterior
        for new, old in zip(second.objects, first.objects, strict=True)
    )


def test_what_was_left_out_stays_out_unless_it_is_recognised(scene, first):
    aside = np.where(scene.segmap == WHOLE, 0, scene.segmap)
    assert of_left_out(scene, aside) == {CUT, STRANGER}
    half = np.cumsum(scene.segmap == WHOLE).reshape(scene.shape)
    smaller = np.where((scene.segmap == WHOLE) & (half < 0.4 * half.max()), 9, 0)
    assert of_left_out(scene, smaller) == set()

    found = without_strangers(taken(first, scene, 0.96), aside, SegmentConfig())
    assert [each.object_id for each in found.objects] == [WHOLE, CUT]
    assert found.frame.object_ids == [WHOLE, CUT]
    result = taken(first, scene, 0.96)
    assert without_strangers(result, np.zeros_like(aside), SegmentConfig()) is result


def test_what_the_border_cuts_is_a_part_and_needs_more_weight(first, scene):
    """As a part of a mask does (`regroup.sure`); what seems to hang needs `regroup.whole`."""
    result = taken(first, scene, 0.9)
    left = without_strangers(result, scene.segmap == CUT, SegmentConfig())
    assert [each.object_id for each in left.objects] == [WHOLE, STRANGER]
    inside = np.zeros(scene.shape, np.int64)
    inside[100:140, 100:140] = CUT
    hanging = replace(result, frame=scene.with_masks(inside), objects=result.objects[1:2])
    assert without_strangers(hanging, inside, SegmentConfig()) is hanging


def taken(first, scene, weight):
    """The whole object, the cut one taken for a stored one with that weight, and a stranger."""
    known = Retrieved("blue_box", 0.9, np.eye(4), weight=weight)
    objects = [
        ObjectReconstruction(WHOLE, OK),
        ObjectReconstruction(CUT, OK, retrieved=[known]),
        ObjectReconstruction(STRANGER, OK),
    ]
    return replace(first, frame=scene, objects=objects)
