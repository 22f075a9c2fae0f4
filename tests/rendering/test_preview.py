"""The picture beside a result."""

import numpy as np
import pytest
import trimesh

from brrp_cli.frames.build import make_frame
from brrp_cli.reconstruction import LOGIT_VARIANCE, METRES, ObjectReconstruction, Retrieved, Surface
from brrp_cli.rendering.framing import near_others
from brrp_cli.rendering.preview import (
    CAPTION,
    PANEL_WIDTH,
    _font,
    _listing,
    _told,
    preview,
    wrapped,
)
from brrp_cli.segmentation.mask_picture import object_colours

K = np.array([[100.0, 0, 80], [0, 100, 60], [0, 0, 1]])


def item(retrieved, *, missing=0.0, weight=None, message=""):
    return ObjectReconstruction(
        1,
        "ok",
        message,
        retrieved=retrieved,
        unknown_probability=missing,
        unknown_weight=weight,
    )


def test_the_list_tells_weights_and_probabilities_largest_first():
    retrieved = [
        Retrieved("mug", 0.3, weight=0.9),
        Retrieved("can", 0.1, weight=0.0),
        Retrieved("box", 0.001, weight=0.02),
    ]
    weights, shares = _told(item(retrieved, missing=0.599, weight=0.08))
    assert weights == "1: ok; weights mug 0.90, none of them 0.08, box 0.02"
    assert shares == "none of them 0.60, mug 0.30, can 0.10"


def test_without_weights_or_retrieval_the_list_tells_what_there_is():
    evenly = [Retrieved(name, 0.002) for name in ("a", "b")]
    assert _told(item(evenly)) == ("1: ok", "a 0.00")
    assert _told(item([], message="7 valid depth points")) == ("1: ok", "7 valid depth points")


@pytest.mark.parametrize("unit", [METRES, LOGIT_VARIANCE])
def test_the_colour_scale_hides_nothing_of_the_scene(unit):
    """A table's worth of mesh fills every panel to its edges; no panel shows the scale's paper."""
    segmap = np.zeros((120, 160), int)
    segmap[40:80, 60:100] = 1
    frame = make_frame(
        rgb=np.zeros((120, 160, 3), np.uint8), segmap=segmap, depth=np.full((120, 160), 1.0), K=K
    )
    mesh = trimesh.creation.box((4.0, 4.0, 0.1))
    mesh.apply_translation([0, 0, 1.05])
    surface = Surface(
        mesh.vertices, mesh.faces, np.full(len(mesh.vertices), 0.004, np.float32), unit
    )
    whole = ObjectReconstruction(1, "ok", center=np.array([0, 0, 1.0]), surface=surface)
    picture = preview(frame, [whole])
    height = picture.shape[0] // 2
    unsure = picture[height + CAPTION :, PANEL_WIDTH : 2 * PANEL_WIDTH]
    # One colour of viridis's top, shaded: no ink, no paper.
    assert (unsure[..., 2] < unsure[..., 1]).all()
    caption = picture[height : height + CAPTION, 2 * PANEL_WIDTH :]
    assert len(np.unique(caption.reshape(-1, 3), axis=0)) > 100


def test_long_lines_are_wrapped_between_words_and_none_is_lost():
    text = "none of them 0.65, " + ", ".join(f"{i:03d}_some_long_name 0.{i}" for i in range(1, 9))
    for width in (80, 200, 448):
        rows = wrapped(text, _font(13), width)
        assert all(_font(13).getlength(row) <= width for row in rows)
        assert "".join(rows).replace(" ", "") == text.replace(" ", "")
    assert wrapped("short", _font(13), 448) == ["short"]
    assert len(wrapped("x" * 200, _font(13), 100)) > 5, "a word that is wider than a row is broken"


@pytest.mark.parametrize("count", [1, 8, 14])
def test_the_list_leaves_its_right_margin_free_and_names_every_object(count):
    names = [f"{i:03d}_a_rather_long_name_of_a_thing" for i in range(5)]
    retrieved = [Retrieved(name, 0.2, weight=0.2) for name in names]
    objects = [
        ObjectReconstruction(i, "ok", retrieved=retrieved, unknown_weight=0.0) for i in range(count)
    ]
    panel = _listing(objects, (360, 480))
    assert (panel[:, -4:] == 255).all(), "nothing is cut at the edge"
    colours = object_colours(list(range(count)))
    assert len({tuple(colour) for colour in colours.values()}) == count
    for colour in list(colours.values())[:8]:
        assert (panel[:, 8:20] == colour).all(axis=2).any()


def test_what_lies_far_from_all_others_does_not_shrink_the_picture():
    near = [np.array([0.1 * i, 0.0, 0.8]) for i in range(4)]
    middles = np.array([*near, [0.2, 0.0, 3.0]])
    assert near_others(middles).tolist() == [True] * 4 + [False]
    assert near_others(middles[3:]).all(), "of two objects none is far from the others"
    spread = np.array([[0.0, 0, 1], [1.0, 0, 1], [2.0, 0, 1], [3.0, 0, 1]])
    assert near_others(spread).all(), "a scene that is wide as a whole stays whole"
    assert near_others(np.empty((0, 3))).shape == (0,)
