"""Written meshes against exact ones, with values known in closed form."""

import math

import numpy as np
import pytest
import trimesh

from brrp_cli.frames.frame import Frame
from brrp_cli.ground_truth.surface_metrics import (
    SURFACE_METRICS,
    MeshSurface,
    score_written,
    true_surface,
)
from brrp_cli.ground_truth.true_meshes import ExactMesh
from brrp_cli.raycast import look

CENTER = np.array([0.02, -0.03, 0.7])
K = np.array([[400.0, 0, 160], [0, 400.0, 120], [0, 0, 1]])
SHAPE = (240, 320)
RADIUS = 0.05
THING = 4


def ball(radius: float) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(5, radius).apply_translation(CENTER)


def box(*sides: float, shift=(0.0, 0, 0)) -> trimesh.Trimesh:
    return trimesh.creation.box(sides).apply_translation(CENTER + shift)


def truth_of(mesh: trimesh.Trimesh, before: trimesh.Trimesh | None = None, pieces: int = 1):
    """Seen by a camera at the origin; `before` stands in its way."""
    sight = look([mesh] if before is None else [mesh, before], K, SHAPE)
    segmap = np.where(sight.index == 0, THING, 0)
    points = np.zeros((*SHAPE, 3), np.float32)
    frame = Frame(np.zeros((*SHAPE, 3), np.uint8), points, segmap, K, np.eye(4))
    return true_surface(ExactMesh(mesh, 0.1, pieces), frame, THING, "scene", 0)


def score(mesh, truth):
    found = score_written(mesh, truth, "scene", 0)
    assert tuple(sorted(found)) == tuple(sorted(SURFACE_METRICS))
    return found


@pytest.fixture(scope="module")
def sphere():
    return truth_of(ball(RADIUS))


def test_the_true_mesh_itself_is_perfect():
    # Sharp edges, where the nearest face is that of the point itself or one beside it.
    mesh = box(0.1, 0.06, 0.08)
    found = score(mesh.copy(), truth_of(mesh))
    for name in ("f_score_2mm", "f_score_5mm", "f_score_10mm"):
        assert found[name] == 1.0
    for name in ("surface_distance", "surface_bias", "surface_distance_seen", "surface_bias_seen"):
        assert found[name] == pytest.approx(0.0, abs=1e-7)
    assert found["normal_consistency"] == pytest.approx(1.0, abs=1e-3)
    assert found["normal_consistency_seen"] == pytest.approx(1.0, abs=1e-3)
    assert found["volume_ratio"] == pytest.approx(1.0, abs=1e-6)
    assert found["watertight"] == found["pieces"] == found["one_piece"] == 1.0


@pytest.mark.parametrize("grown", [0.001, -0.001, 0.003])
def test_spheres_in_spheres(sphere, grown):
    found = score(ball(RADIUS + grown), sphere)
    for name in ("distance_to_truth", "distance_from_truth", "surface_distance"):
        assert found[name] == pytest.approx(abs(grown), abs=5e-5)
    for side in ("", "_seen", "_unseen"):
        assert found[f"surface_distance{side}"] == pytest.approx(abs(grown), abs=5e-5)
        assert found[f"surface_bias{side}"] == pytest.approx(grown, abs=5e-5)
    assert found["f_score_2mm"] == (1.0 if abs(grown) < 0.002 else 0.0)
    assert found["f_score_5mm"] == found["f_score_10mm"] == 1.0
    ratio = ((RADIUS + grown) / RADIUS) ** 3
    assert found["volume_ratio"] == pytest.approx(ratio, rel=1e-4)
    assert found["volume_within_10"] == (abs(ratio - 1) <= 0.1)
    assert found["volume_within_25"] == 1.0
    assert found["normal_consistency"] == pytest.approx(1.0, abs=0.002)


def test_the_mean_of_a_distance_that_varies():
    d, large, side = 0.004, 0.1**2, 4 * 0.1 * 0.01
    found = score(box(0.1, 0.1, 0.01, shift=(0, 0, d)), truth_of(box(0.1, 0.1, 0.01)))
    # Of either plate one large face lies d outside of the other plate. The other one lies d inside,
    # but nearer to the sides close to its border: what min(d, way to the border) adds up to is a
    # frustum. Of the sides 4/10 stick out, 2 mm in the mean.
    frustum = d / 3 * (large + (0.1 - 2 * d) ** 2 + 0.1 * (0.1 - 2 * d))
    expected = (large * d + frustum + side * 0.4 * d / 2) / (2 * large + side)
    assert found["surface_distance"] == pytest.approx(expected, rel=0.01)
    # One of the large faces lies outside of the truth, the other inside.
    assert abs(found["surface_bias"]) < 0.0003


def test_a_solid_where_a_shell_is(sphere):
    hollow = trimesh.util.concatenate([ball(RADIUS), ball(RADIUS - 0.002)])
    hollow.faces[len(hollow.faces) // 2 :] = hollow.faces[len(hollow.faces) // 2 :, ::-1]
    shell = truth_of(hollow, pieces=2)
    found = score(ball(RADIUS), shell)
    inner = (RADIUS - 0.002) ** 3
    assert found["volume_ratio"] == pytest.approx(RADIUS**3 / (RADIUS**3 - inner), rel=1e-3)
    assert found["volume_within_25"] == 0.0 and found["distance_to_truth"] < 1e-5
    # Half of the true surface, nearly, lies 2 mm inside.
    share = (RADIUS - 0.002) ** 2 / (RADIUS**2 + (RADIUS - 0.002) ** 2)
    assert found["distance_from_truth"] == pytest.approx(0.002 * share, rel=0.05)
    assert found["one_piece"] == 1.0
    # And the other way round: a cavity is a piece that the true ball does not have.
    back = score(hollow, sphere)
    assert (back["pieces"], back["one_piece"], back["watertight"]) == (2.0, 0.0, 1.0)


def test_a_box_in_two_pieces():
    halves = trimesh.util.concatenate(
        [box(0.04, 0.1, 0.1, shift=(-0.03, 0, 0)), box(0.04, 0.1, 0.1, shift=(0.03, 0, 0))]
    )
    found = score(halves, truth_of(box(0.1, 0.1, 0.1)))
    assert (found["pieces"], found["one_piece"], found["watertight"]) == (2.0, 0.0, 1.0)
    assert found["volume_ratio"] == pytest.approx(0.8)
    assert found["volume_within_10"] == 0.0 and found["volume_within_25"] == 1.0
    # The true mesh is in two pieces: so may this be.
    assert score(halves, truth_of(halves, pieces=2))["one_piece"] == 1.0


def test_an_open_mesh_has_no_volume(sphere):
    lid = ball(RADIUS)
    lid.update_faces(lid.triangles_center[:, 2] < CENTER[2] + 0.045)
    found = score(lid, sphere)
    assert found["watertight"] == 0.0 and math.isnan(found["volume_ratio"])
    assert found["volume_within_10"] == found["volume_within_25"] == 0.0
    assert found["pieces"] == 1.0 and 0.95 < found["f_score_2mm"] < 1.0
    # What faces inward is no solid either.
    assert score(ball(RADIUS).copy(), sphere)["watertight"] == 1.0
    inverted = ball(RADIUS)
    inverted.invert()
    assert score(inverted, sphere)["watertight"] == 0.0


@pytest.mark.parametrize("mesh", [None, trimesh.Trimesh()], ids=["none", "empty"])
def test_no_mesh_is_a_failure(sphere, mesh):
    found = score(mesh, sphere)
    zero = ("f_score_2mm", "f_score_5mm", "f_score_10mm", "watertight", "pieces", "one_piece")
    for name in SURFACE_METRICS:
        value = found[name]
        assert value == 0.0 if name in zero or name.startswith("volume_w") else math.isnan(value)


def test_the_camera_sees_the_side_that_faces_it():
    mesh = box(0.1, 0.1, 0.1)
    truth = truth_of(mesh)
    front = truth.points[:, 2] < CENTER[2] - 0.05 + 1e-6
    back = truth.points[:, 2] > CENTER[2] + 0.05 - 1e-6
    assert truth.seen[front].mean() > 0.97 and not truth.seen[back].any()
    # Half of it behind something else.
    hidden = truth_of(mesh, box(0.1, 0.4, 0.01, shift=(0.05, 0, -0.1)))
    left = front & (hidden.points[:, 0] < CENTER[0] - 0.02)
    right = front & (hidden.points[:, 0] > CENTER[0] + 0.02)
    assert hidden.seen[left].mean() > 0.97 and not hidden.seen[right].any()


def test_seen_and_unseen_sides_are_told_apart():
    # The camera's side is right, the other one 6 mm off.
    mesh = box(0.1, 0.1, 0.1)
    longer = box(0.1, 0.1, 0.106, shift=(0, 0, 0.003))
    found = score(longer, truth_of(mesh))
    assert found["surface_distance_seen"] < 1e-4 < 0.001 < found["surface_distance_unseen"]
    assert found["surface_bias_unseen"] > 0.001 and abs(found["surface_bias_seen"]) < 1e-4


def test_normals_of_a_rough_surface_are_less_consistent(sphere):
    rough = ball(RADIUS)
    away = np.random.default_rng(0).normal(0, 0.0005, len(rough.vertices))
    rough.vertices += away[:, None] * (rough.vertices - CENTER) / RADIUS
    found = score(rough, sphere)
    assert found["normal_consistency"] < 0.97 and found["normal_consistency_seen"] < 0.97
    assert found["f_score_2mm"] > 0.99


def test_scores_do_not_depend_on_the_place_nor_on_the_order_of_faces(sphere):
    mesh = ball(RADIUS + 0.001)
    far = ExactMesh(ball(RADIUS).apply_translation([0, 0, 30.0]), 0.1, 1)
    moved = true_surface(far, sphere.frame, THING, "scene", 0)
    found = score(mesh.copy().apply_translation([0, 0, 30.0]), moved)
    assert found["surface_distance"] == pytest.approx(0.001, abs=5e-5)
    shuffled = trimesh.Trimesh(mesh.vertices, mesh.faces[::-1], process=False)
    again, first = score(shuffled, sphere), score(mesh, sphere)
    assert again["surface_distance"] == pytest.approx(first["surface_distance"], rel=1e-2)
    assert again["volume_ratio"] == pytest.approx(first["volume_ratio"])


def test_nearest_points_of_a_plane():
    surface = MeshSurface(box(0.1, 0.1, 0.1))
    above = CENTER + np.array([[0.01, 0.02, -0.07], [0.0, 0.0, -0.051]])
    found = surface.nearest(above)
    np.testing.assert_allclose(found.distance, [0.02, 0.001], atol=1e-7)
    np.testing.assert_allclose(np.abs(found.normals), [[0, 0, 1]] * 2, atol=1e-6)
    foot = CENTER + [[0.01, 0.02, -0.05], [0, 0, -0.05]]
    np.testing.assert_allclose(found.points, foot, atol=1e-7)
    assert surface.inside(np.array([CENTER, CENTER + 0.06])).tolist() == [True, False]
