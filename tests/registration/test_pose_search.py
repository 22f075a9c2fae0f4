"""The search finds solids where they stand, in depth without noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from table_scene import (
    MESHES,
    PARAMETERS,
    T_CAM_WORLD,
    TABLE,
    in_camera,
    photograph,
    placed,
    stored,
)

from brrp_cli.config import SearchConfig, WeighConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration import verification as verifier
from brrp_cli.registration.begin import best_brought_nearer, coarse_score
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import different, search
from brrp_cli.registration.scale_scan import observed_cloud
from brrp_cli.registration.weigh import weigh

ID = 5
CONFIG = SearchConfig()


def find(name, T_cam_mesh, *, size=1.0, plane=TABLE, seed=0, config=CONFIG, best=-np.inf):
    """Hypotheses about an object of that many times the stored size, seen from the front."""
    mesh = MESHES[name]()
    mesh.apply_scale(size)
    frame = photograph({ID: in_camera(mesh, T_cam_mesh)}, table=plane is not None)
    points = np.random.default_rng(0).permutation(frame.object_points(ID)).astype(np.float64)
    return search(
        search_model(stored(name)),
        observed_cloud(points, PARAMETERS.features),
        verifier.Verifier(points, frame, plane),
        PARAMETERS.features,
        config,
        seed,
        best,
    )


def errors(hypothesis, T_cam_mesh, size=1.0):
    """How far (n,), metres, the placed surface's points are from where they truly are."""
    model = hypothesis.model
    true = transform_points(T_cam_mesh, (model.surface + model.stored.center) * size)
    return np.linalg.norm(transform_points(hypothesis.T_cam_model, model.surface) - true, axis=1)


@pytest.mark.parametrize("yaw", [0.0, 2.5])
def test_an_ell_is_found_where_it_stands_at_its_own_size(yaw):
    truth = placed(0.02, -0.03, yaw)
    found = find("ell", truth)
    assert errors(found[0], truth).max() < 0.002
    assert found[0].scale == 1.0
    assert found[0].alignment_score > 0.8
    assert 1 <= len(found) <= CONFIG.kept
    alignment_score = [each.alignment_score for each in found]
    assert alignment_score == sorted(alignment_score, reverse=True)


def test_a_box_is_found_up_to_what_maps_it_to_itself():
    truth = placed(-0.04, 0.02, 0.6)
    best = find("box", truth)[0]
    surface = transform_points(best.T_cam_model, best.model.surface)
    local = transform_points(np.linalg.inv(truth), surface) - [0, 0, 0.07]
    # Distance to the surface of the true box, from inside and from outside.
    beyond = np.abs(local) - [0.05, 0.03, 0.07]
    assert np.abs(beyond.max(axis=1)).max() < 0.004


def size_of(hypothesis):
    return np.cbrt(np.linalg.det(hypothesis.T_cam_model[:3, :3]))


@pytest.mark.parametrize("size", [0.78, 0.85, 1.13, 1.2])
def test_an_object_of_another_size_is_found_with_its_size(size):
    """None of these is where the refinement begins, but for one."""
    truth = placed(0.0, 0.03, 1.2)
    best = find("ell", truth, size=size)[0]
    assert best.scale == pytest.approx(size, rel=0.03)
    assert size_of(best) == pytest.approx(best.scale)
    assert errors(best, truth, size).max() < 0.004


@pytest.mark.parametrize(("name", "yaw"), [("ell", 0.3), ("ell", 2.0), ("box", 0.6), ("box", 1.5)])
def test_an_object_at_its_own_size_is_never_found_at_another(name, yaw):
    """Though other sizes are asked for, whatever the score: they cost, and sizes that come out next
    to the true one are no other hypotheses."""
    truth = placed(0.03, -0.02, yaw)
    found = find(name, truth, config=replace(CONFIG, settled=np.inf))
    assert found[0].scale == 1.0 and size_of(found[0]) == pytest.approx(1)
    for each in found:
        assert size_of(each) == pytest.approx(each.scale)
        if each.scale != 1.0:
            assert abs(np.log(each.scale)) > CONFIG.least_size_change
            assert each.alignment_score < found[0].alignment_score - 0.1


def test_the_weight_of_another_size_is_what_its_cost_says():
    """An object of 0.85 of its size: the frame is for it, the prior against it."""
    truth = placed(0.0, 0.03, 1.2)
    cheap, dear = (
        find("ell", truth, size=0.85, config=replace(CONFIG, size_cost=cost)) for cost in (0.0, 0.2)
    )
    one, other = (max(found, key=lambda h: h.scale < 0.95) for found in (cheap, dear))
    assert one.scale == pytest.approx(other.scale) == pytest.approx(0.85, rel=0.03)
    assert one.alignment_score - other.alignment_score == pytest.approx(0.2)
    spread = CONFIG.size_spread_cost * np.log(one.scale) ** 2
    unspread = find(
        "ell", truth, size=0.85, config=replace(CONFIG, size_cost=0.0, size_spread_cost=0.0)
    )[0]
    assert unspread.alignment_score - one.alignment_score == pytest.approx(spread, abs=1e-9)
    weights = weigh([0.9] * len(cheap), [h.alignment_score for h in cheap], 0.1, WeighConfig())
    assert weights[cheap.index(one)] == weights.max()


def test_no_other_size_is_tried_of_what_lies_well_enough():
    """An object of 0.8 of its size, when any score is held for enough, and when none is."""
    truth = placed(0.0, 0.03, 1.2)
    settled, tried = (
        find("ell", truth, size=0.8, config=replace(CONFIG, settled=enough))
        for enough in (-np.inf, np.inf)
    )
    assert {each.scale for each in settled} == {1.0}
    assert tried[0].scale == pytest.approx(0.8, rel=0.03)
    assert tried[0].alignment_score > settled[0].alignment_score


@pytest.mark.parametrize("limit", ["unpromising", "hopeless"])
def test_what_is_hopeless_is_judged_as_it_lies(limit):
    truth = placed(0.0, 0.03, 1.2)
    config = replace(CONFIG, settled=np.inf)
    left = find("ell", truth, size=0.8, config=replace(config, **{limit: np.inf}))
    assert len(left) == 1 and left[0].scale == 1.0
    assert left[0].alignment_score < find("ell", truth, size=0.8, config=config)[0].alignment_score


def test_what_another_model_has_beaten_is_judged_as_it_lies():
    truth = placed(0.0, 0.03, 1.2)
    config = replace(CONFIG, settled=np.inf)
    close, beaten = (
        find("ell", truth, size=0.8, config=config, best=best)
        for best in (CONFIG.beaten, 1 + CONFIG.beaten)
    )
    assert len(beaten) == 1 and beaten[0].scale == 1.0
    assert beaten[0].alignment_score < close[0].alignment_score
    assert close[0].scale == pytest.approx(0.8, rel=0.03)


def test_without_a_plane_feature_matchings_are_enough():
    """It stands in the air, and on its head."""
    over = similarity(rotation=np.diag([1.0, -1.0, -1.0]), translation=np.array([0, 0, 0.1]))
    truth = placed(0.02, -0.03, 1.2) @ over
    best = find("ell", truth, plane=None)[0]
    assert errors(best, truth).max() < 0.002


@pytest.mark.parametrize("turned", [(35, 20, 60), (-50, 10, 200), (0, 0, 30)])
def test_an_object_that_leans_or_lies_on_others_is_found(turned):
    """It stands in none of its resting poses on the table, and has no features to match."""
    T_world_mesh = similarity(translation=np.array([0.05, -0.04, 0.1]))
    T_world_mesh[:3, :3] = Rotation.from_euler("xyz", turned, degrees=True).as_matrix()
    truth = T_CAM_WORLD @ T_world_mesh
    config = replace(CONFIG, matchings=0)
    assert errors(find("ell", truth, config=config)[0], truth).max() < 0.003


def test_what_is_brought_nearer_is_chosen_by_where_it_comes_to():
    """A placement that is off by 8 mm and 6 degrees comes nearer; one in the air does not."""
    truth = placed(0.02, -0.03, 0.9)
    model = search_model(stored("ell"))
    frame = photograph({ID: in_camera(MESHES["ell"](), truth)})
    points = np.random.default_rng(0).permutation(frame.object_points(ID)).astype(np.float64)
    seen = verifier.Verifier(points, frame, TABLE)
    T_cam_model = truth @ similarity(translation=model.stored.center)
    aside = T_cam_model @ similarity(
        rotation=Rotation.from_euler("z", 6, degrees=True).as_matrix(),
        translation=np.array([0.008, 0, 0]),
    )
    away = similarity(translation=np.array([0, 0, -0.12])) @ T_cam_model
    config = replace(CONFIG, coarse=1)
    chosen, _ = best_brought_nearer(np.stack([away, aside, away]), model, seen, config)

    def off(T):
        true = transform_points(T_cam_model, model.surface)
        return np.linalg.norm(transform_points(T, model.surface) - true, axis=1).mean()

    assert len(chosen) == 1
    assert off(chosen[0]) < 0.5 * off(aside)
    assert coarse_score(np.stack([aside, *chosen]), model, seen, CONFIG).argmax() == 1


def test_an_object_is_found_whose_one_end_is_hidden():
    """A long box of which a screen in front lets a third be seen."""
    truth = placed(0.0, 0.0, 0.1)
    frame = photograph({ID: in_camera(MESHES["ell"](), truth)})
    shown = frame.segmap == ID
    columns = np.flatnonzero(shown.any(axis=0))
    screen = shown & (np.arange(shown.shape[1]) > columns[0] + len(columns) // 2)
    points = frame.points.copy()
    points[screen] *= 0.8
    segmap = np.where(screen, ID + 1, frame.segmap)
    frame = replace(frame, points=points, segmap=segmap)
    seen = np.random.default_rng(0).permutation(frame.object_points(ID)).astype(np.float64)
    found = search(
        search_model(stored("ell")),
        observed_cloud(seen, PARAMETERS.features),
        verifier.Verifier(seen, frame, TABLE),
        PARAMETERS.features,
        CONFIG,
        0,
    )
    assert errors(found[0], truth).max() < 0.003


def test_placements_that_are_all_but_a_better_one_are_left_out():
    turn, shift = CONFIG.same_turn, CONFIG.same_shift
    first = placed(0.02, -0.03, 0.9)
    near = first @ similarity(rotation=Rotation.from_euler("z", 0.9 * turn).as_matrix())
    aside = first @ similarity(translation=np.array([0, 0.9 * shift, 0]))
    turned = first @ similarity(rotation=Rotation.from_euler("x", 1.1 * turn).as_matrix())
    away = first @ similarity(translation=np.array([1.1 * shift, 0, 0]))
    kept = different(np.stack([first, near, turned, aside, away, first]), CONFIG)
    np.testing.assert_array_equal(kept, np.stack([first, turned, away]))


@pytest.mark.parametrize("name", ["box", "ell"])
def test_hypotheses_differ_in_shape(name):
    """A box looks the same turned by half a circle: that is one hypothesis."""
    found = find(name, placed(-0.04, 0.02, 0.6))
    for i, one in enumerate(found):
        surface = transform_points(one.T_cam_model, one.model.surface[:300])
        for other in found[:i]:
            local = transform_points(np.linalg.inv(other.T_cam_model), surface)
            assert np.abs(other.model.signed_distance(local)).mean() > CONFIG.distinct


def test_the_same_seed_gives_the_same_bytes():
    truth = placed(0.02, -0.03, 0.9)
    first, again = (find("ell", truth, seed=4) for _ in range(2))
    assert [each.T_cam_model.tobytes() for each in first] == [
        each.T_cam_model.tobytes() for each in again
    ]
    assert [each.alignment_score for each in first] == [each.alignment_score for each in again]


def test_a_wrong_object_is_less_believed_than_the_right_one():
    truth = placed(0.02, -0.03, 0.4)
    frame = photograph({ID: in_camera(MESHES["ell"](), truth)})
    points = np.random.default_rng(0).permutation(frame.object_points(ID)).astype(np.float64)
    observed = observed_cloud(points, PARAMETERS.features)
    seen = verifier.Verifier(points, frame, TABLE)
    right, wrong = (
        search(search_model(stored(name)), observed, seen, PARAMETERS.features, CONFIG, 0)[0]
        for name in ("ell", "box")
    )
    assert wrong.alignment_score < right.alignment_score - 0.2


def test_the_placement_from_normalised_coordinates_is_the_same_one():
    truth = placed(0.02, -0.03, 0.9)
    best = find("ell", truth)[0]
    placed_surface = transform_points(best.T_cam_model, best.model.surface)
    normalised = best.model.stored.surface.astype(np.float64)
    np.testing.assert_allclose(
        transform_points(best.T_cam_object, normalised), placed_surface, atol=1e-7
    )
