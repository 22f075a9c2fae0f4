"""Colour tells apart what depth cannot: a box that is turned about itself."""

from dataclasses import replace

import numpy as np
import pytest
from sparse_depth import without_depth
from table_scene import MESHES, TABLE, in_camera, photograph, placed, stored

from brrp_cli.config import ColourConfig, SearchConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis, by_colour
from brrp_cli.registration.print_agreement import print_agreement
from brrp_cli.registration.verification import Verifier

CONFIG = ColourConfig()


@pytest.fixture(scope="module")
def scene():
    """A stored box that is red at one end and blue at the other, where it stands, and the image
    that shows it so in other light."""
    model = search_model(stored("box"))
    shape = model.stored.shape
    ends = np.where(shape.vertices[:, :1] > 0, [[200, 30, 30]], [[30, 30, 200]]).astype(np.uint8)
    model = replace(model, stored=replace(model.stored, shape=replace(shape, colours=ends)))
    T_cam_mesh = placed(0.0, 0.0, 0.4)
    T = T_cam_mesh @ similarity(translation=model.stored.center)
    frame = photograph({1: in_camera(MESHES["box"](), T_cam_mesh)})
    local = transform_points(np.linalg.inv(T), np.nan_to_num(frame.points.reshape(-1, 3)))
    rgb = np.where(local[:, :1] > 0, [[150, 60, 90]], [[60, 60, 170]]).astype(np.uint8)
    return model, T, replace(frame, rgb=rgb.reshape(frame.rgb.shape))


def test_the_colours_agree_where_the_box_stands_as_it_is_stored(scene) -> None:
    model, T, frame = scene
    back_to_front = T @ similarity(rotation=np.diag([-1.0, -1.0, 1.0]))
    assert print_agreement(T, model, frame, CONFIG) > 0.8
    assert print_agreement(back_to_front, model, frame, CONFIG) < -0.8


def test_one_colour_tells_nothing(scene) -> None:
    model, T, frame = scene
    shape = replace(model.stored.shape, colours=np.full_like(model.stored.shape.colours, 90))
    plain = replace(model, stored=replace(model.stored, shape=shape))
    assert print_agreement(T, plain, frame, CONFIG) == 0


def test_the_search_turns_a_box_round_by_its_colours(scene) -> None:
    model, T, frame = scene
    back_to_front = T @ similarity(rotation=np.diag([-1.0, -1.0, 1.0]))
    points = np.random.default_rng(0).permutation(frame.object_points(1)).astype(np.float64)
    record = {**model.stored.record, "coloured": True}
    model = replace(model, stored=replace(model.stored, record=record))
    best = Hypothesis(model, back_to_front, 1.0, 0.95)
    aside = replace(best, T_cam_model=similarity(translation=np.array([0.01, 0, 0])) @ T)
    config = SearchConfig()
    verifier = Verifier(points, frame, TABLE)
    # Upside down the box is the same, in colour too.
    turned, *others = by_colour([best, best, aside], verifier, config)
    np.testing.assert_allclose(turned.T_cam_model[:3, [0, 3]], T[:3, [0, 3]], atol=2e-3)
    assert turned.alignment_score == best.alignment_score
    assert all(each is aside for each in others), "no other that is back to front"
    right = replace(best, T_cam_model=T)
    kept = by_colour([right, replace(aside, alignment_score=0.5)], verifier, config)[0]
    np.testing.assert_allclose(kept.T_cam_model[:3, [0, 3]], T[:3, [0, 3]], atol=2e-3)


def test_colours_count_too_where_an_object_has_lost_its_depth(scene) -> None:
    model, T, frame = scene
    dark = without_depth(frame, 1)
    lost = dark.segmap == 1
    assert print_agreement(T, model, dark, CONFIG) == 0
    assert print_agreement(T, model, dark, CONFIG, lost) > 0.8
    back_to_front = T @ similarity(rotation=np.diag([-1.0, -1.0, 1.0]))
    assert print_agreement(back_to_front, model, dark, CONFIG, lost) < -0.8


def test_faint_print_says_little_and_strong_print_all(scene) -> None:
    model, T, frame = scene
    assert print_agreement(T, model, frame, CONFIG) > 0.8

    def fainter(share):
        """The same print, faded to grey."""
        faded = 115 + share * (model.stored.shape.colours.astype(float) - 115)
        shape = replace(model.stored.shape, colours=faded.round().astype(np.uint8))
        return replace(model, stored=replace(model.stored, shape=shape))

    assert 0 < print_agreement(T, fainter(0.1), frame, CONFIG) < 0.3
    assert print_agreement(T, fainter(0.05), frame, CONFIG) == 0


def seen_sides(model, T, frame):
    """Which vertices of the box, and which of its pixels (H, W), lie on its upper side."""
    vertices = model.stored.shape.normals[:, 2] > 0.7
    points = np.nan_to_num(frame.points.reshape(-1, 3))
    local = transform_points(np.linalg.inv(T), points)
    top = local[:, 2] > 0.98 * local[frame.segmap.ravel() == 1, 2].max()
    return vertices, top.reshape(frame.shape)


def test_print_is_read_in_a_grey_image_too(scene) -> None:
    """Red and blue of other brightness, as a monochrome camera sees them."""
    model, T, frame = scene
    grey = frame.rgb.mean(axis=-1, keepdims=True).repeat(3, axis=-1)
    light = np.where(frame.rgb[..., :1] > frame.rgb[..., 2:], 180, 60).repeat(3, axis=-1)
    frame = replace(frame, rgb=np.where(frame.segmap[..., None] == 1, light, grey).astype(np.uint8))
    assert frame.hueless
    ends = np.where(model.stored.shape.vertices[:, :1] > 0, [[240, 30, 30]], [[30, 30, 90]])
    shape = replace(model.stored.shape, colours=ends.astype(np.uint8))
    model = replace(model, stored=replace(model.stored, shape=shape))
    back_to_front = T @ similarity(rotation=np.diag([-1.0, -1.0, 1.0]))
    # Two of the box's sides are of one colour: these do not count.
    assert print_agreement(T, model, frame, CONFIG) > 0.6
    assert print_agreement(back_to_front, model, frame, CONFIG) < -0.6


def raw_correlation(T, model, frame):
    """Of stored colours with the image's, each channel about its mean, light and shadow with it."""
    points = transform_points(T, model.stored.shape.vertices * model.stored.half_extent)
    u, v = np.rint((points / points[:, 2:] @ frame.K.T)[:, :2]).astype(int).T
    seen = np.abs(frame.depth[v, u] - points[:, 2]) < CONFIG.near
    stored, image = (
        each - each.mean(axis=0)
        for each in (model.stored.shape.colours[seen].astype(float), frame.rgb[v, u][seen])
    )
    return (stored * image).sum() / np.sqrt((stored**2).sum() * (image**2).sum())


def test_how_bright_a_side_is_tells_nothing_of_how_a_plain_box_is_turned(scene) -> None:
    """It was scanned in light from below, and is seen in light from above."""
    model, T, frame = scene
    vertices, top = seen_sides(model, T, frame)
    grey = np.where(vertices[:, None], 90, 150).repeat(3, axis=1).astype(np.uint8)
    plain = replace(
        model,
        stored=replace(model.stored, shape=replace(model.stored.shape, colours=grey)),
    )
    lit = np.where(top[..., None], 200, 80).repeat(3, axis=2).astype(np.uint8)
    frame = replace(frame, rgb=lit)
    assert raw_correlation(T, plain, frame) < -0.8
    # Its edges belong to two sides.
    assert abs(print_agreement(T, plain, frame, CONFIG)) < 0.2


def test_print_tells_how_a_box_is_turned_in_whatever_light(scene) -> None:
    model, T, frame = scene
    vertices, top = seen_sides(model, T, frame)
    back_to_front = T @ similarity(rotation=np.diag([-1.0, -1.0, 1.0]))
    dark_above = model.stored.shape.colours.astype(float) * np.where(vertices[:, None], 0.5, 1.0)
    shape = replace(model.stored.shape, colours=dark_above.astype(np.uint8))
    model = replace(model, stored=replace(model.stored, shape=shape))
    lit = frame.rgb * np.where(top[..., None], 1.4, 0.5)
    frame = replace(frame, rgb=lit.clip(0, 255).astype(np.uint8))
    right, wrong = (print_agreement(each, model, frame, CONFIG) for each in (T, back_to_front))
    assert right > 0.6 and wrong < -0.6
    assert right > raw_correlation(T, model, frame)


def test_dim_light_leaves_print_as_it_is(scene) -> None:
    model, T, frame = scene
    bright = print_agreement(T, model, frame, CONFIG)
    dim = replace(frame, rgb=(0.4 * frame.rgb).astype(np.uint8))
    assert print_agreement(T, model, dim, CONFIG) == pytest.approx(bright, abs=0.02)


def test_light_on_a_plain_ball_is_no_print() -> None:
    """Scanned in light from one side, and seen in light from the same: all that agrees is light."""
    model = search_model(stored("ball"))
    T_cam_mesh = placed(0.0, 0.0, 0.4)
    T = T_cam_mesh @ similarity(translation=model.stored.center)
    frame = photograph({1: in_camera(MESHES["ball"](), T_cam_mesh)})
    yellow, shape = np.array([220.0, 190.0, 60.0]), model.stored.shape
    scanned = yellow * (0.7 + 0.3 * shape.normals[:, :1])
    lit = replace(shape, colours=scanned.astype(np.uint8))
    model = replace(model, stored=replace(model.stored, shape=lit))
    local = transform_points(np.linalg.inv(T), np.nan_to_num(frame.points.reshape(-1, 3)))
    normals = local / np.linalg.norm(local, axis=1, keepdims=True)
    seen = (yellow * (0.6 + 0.4 * normals[:, :1])).clip(0, 255).astype(np.uint8)
    frame = replace(frame, rgb=seen.reshape(frame.rgb.shape))
    assert raw_correlation(T, model, frame) > 0.9
    assert abs(print_agreement(T, model, frame, CONFIG)) < 0.1
