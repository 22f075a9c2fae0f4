"""What a frame says for and against placements whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from table_scene import (
    T_CAM_WORLD,
    TABLE,
    K,
    box,
    in_camera,
    photograph,
    placed,
    stored,
)

from brrp_cli.config import VerificationConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.geometry import backproject, project, similarity, turn_about_z
from brrp_cli.registration import verification as verifier
from brrp_cli.registration.model import Model, search_model

BOX = 5
CONFIG = VerificationConfig()
NORMAL = TABLE.normal


@pytest.fixture(scope="module")
def model():
    return search_model(stored("box"))


@pytest.fixture(scope="module")
def truth():
    """T_cam_model: the model's origin is the middle of its box, 7 cm up."""
    return placed(0.02, -0.03, 0.5) @ similarity(translation=np.array([0, 0, 0.07]))


@pytest.fixture(scope="module")
def seen():
    frame = photograph({BOX: in_camera(box(), placed(0.02, -0.03, 0.5))})
    points = np.random.default_rng(0).permutation(frame.object_points(BOX)).astype(np.float64)
    return verifier.Verifier(points, frame, TABLE)


def moved(T_cam_model, *, world=(0.0, 0.0, 0.0), yaw=0.0):
    """Moved by metres along the world's axes, after a turn about the model's upright axis."""
    T = T_cam_model @ similarity(1.0, turn_about_z(yaw))
    T[:3, 3] += T_CAM_WORLD[:3, :3] @ world
    return T


def score(seen, placements, model, config=CONFIG, *, model_points=2000, seen_points=1000):
    return seen.score(
        np.stack(placements), model, config, model_points=model_points, seen_points=seen_points
    )


def test_the_true_placement_stands_above_the_unknown(seen, truth, model):
    assert score(seen, [truth], model)[0] > 0.8


def test_what_is_missing_from_one_is_the_way_between_stored_points(seen, truth, model):
    surface, faces = trimesh.sample.sample_surface(box(), 60_000, seed=0)
    normals = box().face_normals[faces]
    dense = Model(model.stored, surface - [0, 0, 0.07], normals)
    explained = score(seen, [truth], dense, replace(CONFIG, contradiction=0.0))[0]
    assert 0.97 < explained <= 1
    # The outline is a pixel broad: some of it falls on the table behind.
    whole = score(seen, [truth], dense, model_points=60_000)[0]
    assert explained - 0.1 < whole <= explained


@pytest.mark.parametrize(
    "change",
    [
        {"world": (0.01, 0, 0)},
        {"world": (-0.01, 0, 0)},
        {"world": (0, 0.01, 0)},
        {"world": (0, 0, 0.01)},
        {"world": (0, 0, -0.01)},
        {"yaw": 0.2},
        {"yaw": np.pi / 2},
    ],
)
def test_the_true_placement_is_best(seen, truth, model, change):
    right, wrong = score(seen, [truth, moved(truth, **change)], model)
    assert wrong < right - 0.1


def test_what_looks_the_same_scores_the_same(seen, truth, model):
    right, turned = score(seen, [truth, moved(truth, yaw=np.pi)], model)
    assert turned == pytest.approx(right, abs=0.02)


def test_a_size_too_large_sticks_out_and_one_too_small_leaves_points_unexplained(
    seen, truth, model
):
    center = seen.points.mean(axis=0)
    right, large, small = score(
        seen,
        [
            truth,
            *(
                similarity(factor, translation=(1 - factor) * center) @ truth
                for factor in (1.25, 0.8)
            ),
        ],
        model,
    )
    assert large < right - 0.2 and small < right - 0.2


def test_a_model_in_free_space_is_contradicted(seen, truth, model):
    """20 cm towards the camera it explains nothing and hides what was seen: every observed point
    counts as far, every model point in front of a return as wrong."""
    toward = truth.copy()
    toward[:3, 3] *= 1 - 0.2 / np.linalg.norm(truth[:3, 3])
    found = score(seen, [toward], model)[0]
    assert found == pytest.approx(-CONFIG.distance - CONFIG.contradiction, abs=0.01)


def test_hidden_space_says_nothing(seen, truth, model):
    """20 cm away from the camera it would be below the table; without one, nothing is against."""
    away = truth.copy()
    away[:3, 3] *= 1 + 0.2 / np.linalg.norm(truth[:3, 3])
    free = verifier.Verifier(seen.points, seen.frame, None)
    assert score(free, [away], model)[0] == pytest.approx(-CONFIG.distance, abs=0.02)
    assert score(seen, [away], model)[0] < -CONFIG.distance - 0.5


def test_the_share_below_the_plane_is_counted(seen, truth, model):
    """Half a box's height under the table: half of the upright sides and the bottom."""
    sunk = moved(truth, world=(0, 0, -0.07))
    with_plane = score(seen, [sunk], model)[0]
    without = score(verifier.Verifier(seen.points, seen.frame, None), [sunk], model)[0]
    heights = TABLE.signed_distance(model.surface @ sunk[:3, :3].T + sunk[:3, 3])
    full = (heights < -CONFIG.tolerance - CONFIG.slope).mean()
    some = (heights < -CONFIG.tolerance).mean()
    assert full < (without - with_plane) / CONFIG.contradiction < some


def test_many_placements_are_judged_as_one_by_one(seen, truth, model):
    rng = np.random.default_rng(1)
    many = [
        moved(truth, world=rng.normal(0, 0.03, 3), yaw=rng.uniform(0, 6))
        @ similarity(rng.uniform(0.8, 1.2))
        for _ in range(6)
    ]
    together = score(seen, many, model)
    alone = [score(seen, [each], model)[0] for each in many]
    np.testing.assert_allclose(together, alone, atol=1e-12)
    assert together.shape == (6,) and np.ptp(together) > 0.1


def wall(distance=1.0):
    """A wall across the image, but for a hole at pixel (30, 20)."""
    depth = np.full((80, 100), distance)
    depth[20, 30] = np.nan
    camera = np.array([[100.0, 0, 50], [0, 100, 40], [0, 0, 1]])
    segmap = np.arange(8000).reshape(80, 100)
    return Frame(np.zeros((80, 100, 3), np.uint8), backproject(depth, camera), segmap, camera)


def through(u, v, z):
    """The point at depth z that pixel (u, v) of the wall's camera sees."""
    return [(u - 50) / 100 * z, (v - 40) / 100 * z, z]


def test_depth_behind_is_the_way_to_the_return():
    points = np.array([through(50, 40, 0.75), through(10, 70, 1.5), through(99, 79, 1.0)])
    np.testing.assert_allclose(depth_behind(points, wall()), [0.25, -0.5, 0.0], atol=1e-6)


def test_where_nothing_was_measured_depth_behind_is_not_a_number():
    hole, left, right = through(30, 20, 0.5), through(-1, 40, 0.5), through(100, 40, 0.5)
    below, behind = through(50, 80, 0.5), through(50, 40, -0.5)
    points = np.array([hole, left, right, below, behind])
    assert np.isnan(depth_behind(points, wall())).all()


def test_at_pixels_takes_the_nearest_pixel_by_row_and_column():
    points = np.array([through(u, v, 2.0) for u, v in [(0, 0), (99.4, 78.6), (7, 3), (-0.6, 5)]])
    frame = wall()
    found = at_pixels(points, frame.segmap, frame)
    np.testing.assert_array_equal(found, [0, 7999, 307, np.nan])


def test_every_seen_point_lies_on_its_own_pixel(seen):
    frame = seen.frame
    points = frame.points[frame.segmap == BOX]
    np.testing.assert_allclose(depth_behind(points, frame), 0, atol=1e-6)
    assert (at_pixels(points, frame.segmap, frame) == BOX).all()
    assert np.abs(project(points, K) - np.rint(project(points, K))).max() < 1e-3
