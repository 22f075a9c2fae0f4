"""V-PRISM on a rendered table with two boxes, one behind the other's corner."""

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config import VPrismConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.methods.vprism.method import reconstruct_scene
from brrp_cli.observation.scene_samples import sample_scene
from brrp_cli.reconstruction import OK, TOO_FEW_POINTS
from brrp_cli.surface.extract import grid_axes

# Boxes on the table z = 0 of the world: lower and upper corner, metres.
BOXES = {
    3: np.array([[-0.05, -0.05, 0.0], [0.05, 0.04, 0.11]]),
    9: np.array([[0.10, 0.0, 0.0], [0.18, 0.08, 0.07]]),
}
SPECK = 5
SPECK_PIXELS = 6


def camera(eye, target):
    """T_world_cam, x right, y down, z forward."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    T[:3, 3] = eye
    return T


@pytest.fixture(scope="module")
def frame():
    o3d = import_open3d()
    T = camera(np.array([0.15, -0.55, 0.45]), np.array([0.05, 0.0, 0.03]))
    K = np.array([[300.0, 0, 160], [0, 300.0, 120], [0, 0, 1]])
    scene = o3d.t.geometry.RaycastingScene()
    table = o3d.t.geometry.TriangleMesh.create_box(2, 2, 0.02).translate([-1, -1, -0.02])
    ids = {scene.add_triangles(table): 0}
    for object_id, (lower, upper) in BOXES.items():
        box = o3d.t.geometry.TriangleMesh.create_box(*(upper - lower)).translate(lower)
        ids[scene.add_triangles(box)] = object_id
    rays = scene.create_rays_pinhole(
        o3d.core.Tensor(K), o3d.core.Tensor(np.linalg.inv(T)), width_px=320, height_px=240
    )
    hit = scene.cast_rays(rays)
    distance = hit["t_hit"].numpy().astype(np.float64)
    distance[~np.isfinite(distance)] = np.nan
    rays = rays.numpy()
    world = rays[..., :3] + rays[..., 3:] * distance[..., None]
    segmap = np.vectorize(lambda i: ids.get(i, 0))(hit["geometry_ids"].numpy())
    segmap[0, :SPECK_PIXELS] = SPECK
    return Frame(
        rgb=np.zeros((240, 320, 3), np.uint8),
        points=transform_points(np.linalg.inv(T), world).astype(np.float32),
        segmap=segmap.astype(np.int64),
        K=K,
        T_world_cam=T,
    )


def reconstruct_vprism(frame, config, seed):
    return reconstruct_scene(sample_scene(frame, config.observation, seed), config, seed)


@pytest.fixture(scope="module")
def found(frame):
    return {r.object_id: r for r in reconstruct_vprism(frame, VPrismConfig(), seed=1)}


def to_camera(frame, world):
    return transform_points(np.linalg.inv(frame.T_world_cam), world)


def grid_around(box, margin, spacing):
    axes = [np.arange(a - margin, b + margin, spacing) for a, b in zip(*box, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def within(points, box):
    return ((points >= box[0]) & (points <= box[1])).all(axis=1)


@pytest.mark.parametrize("object_id", BOXES)
def test_boxes_are_found_where_they_stand(frame, found, object_id):
    world = grid_around(BOXES[object_id], 0.1, 0.01)
    occupied = found[object_id].posterior.probability(to_camera(frame, world)) > 0.5
    truth = within(world, BOXES[object_id])
    assert (occupied & truth).sum() / (occupied | truth).sum() > 0.6


def test_space_the_camera_saw_through_is_free(frame, found):
    points = frame.points[frame.valid & (frame.segmap == 0)]
    halfway = points * 0.95  # 3 cm and more in front of the table
    for object_id in BOXES:
        probability = found[object_id].posterior.probability(halfway)
        assert (probability > 0.5).mean() < 0.002


def test_space_below_the_table_is_free(frame, found):
    world = grid_around(np.array([[-0.1, -0.1, -0.12], [0.2, 0.1, -0.03]]), 0.0, 0.02)
    for object_id in BOXES:
        assert found[object_id].posterior.probability(to_camera(frame, world)).max() < 0.5


def test_one_object_is_not_the_other(frame, found):
    inside_9 = to_camera(frame, grid_around(BOXES[9], -0.01, 0.01))
    assert found[9].posterior.probability(inside_9).mean() > 0.7
    assert found[3].posterior.probability(inside_9).mean() < 0.1


def test_what_was_seen_is_less_uncertain_than_what_was_hidden(frame, found):
    posterior = found[3].posterior
    seen = posterior.uncertainty(found[3].observed)
    back = BOXES[3].copy()
    back[0, 1] = back[1, 1] - 0.005  # the side that looks away from the camera
    hidden = posterior.uncertainty(to_camera(frame, grid_around(back, 0.0, 0.01)))
    assert np.median(hidden) > 3 * np.median(seen)
    assert seen.min() >= 0


def test_status_and_contents(frame, found):
    assert {i: r.status for i, r in found.items()} == {3: OK, SPECK: TOO_FEW_POINTS, 9: OK}
    assert found[SPECK].posterior is None
    assert found[SPECK].n_points == SPECK_PIXELS
    assert found[3].n_points == len(found[3].observed) == (frame.segmap == 3).sum()
    inside = found[3].posterior.bounds
    np.testing.assert_allclose(inside.mean(axis=0), found[3].center)
    outside = inside[1:] + 0.001
    assert found[3].posterior.probability(outside)[0] == 0


def test_a_frame_without_usable_objects_gives_their_status_alone(frame):
    alone = replace(frame, segmap=np.where(frame.segmap == SPECK, SPECK, 0))
    (only,) = reconstruct_vprism(alone, VPrismConfig(), seed=1)
    assert only.status == TOO_FEW_POINTS


def test_the_seed_decides_every_number(frame, found):
    points = to_camera(frame, grid_around(BOXES[9], 0.05, 0.02))
    again, other = (
        {r.object_id: r for r in reconstruct_vprism(frame, VPrismConfig(), seed)}[9].posterior
        for seed in (1, 2)
    )
    first = found[9].posterior.probability(points)
    np.testing.assert_array_equal(again.probability(points), first)
    assert not np.array_equal(other.probability(points), first)


def test_a_point_is_answered_alike_alone_and_in_a_crowd(frame, found):
    posterior = found[3].posterior
    points = to_camera(frame, grid_around(BOXES[3], 0.05, 0.01))
    for ask in (posterior.probability, posterior.uncertainty):
        crowd = ask(points)
        alone = np.array([ask(points[i : i + 1])[0] for i in range(0, len(points), 97)])
        np.testing.assert_allclose(alone, crowd[::97], rtol=1e-5, atol=1e-7)


def test_a_plain_list_of_points_is_answered(found):
    center = found[3].center
    for ask in (found[3].posterior.probability, found[3].posterior.uncertainty):
        np.testing.assert_array_equal(ask([list(center)]), ask(center[None]))


def test_updates_in_parts_come_close_to_one_update(frame, found):
    points = to_camera(frame, grid_around(BOXES[3], 0.05, 0.01))
    config = replace(VPrismConfig(), max_update_points=8000)
    parted = {r.object_id: r for r in reconstruct_vprism(frame, config, seed=1)}[3].posterior
    one, parts = found[3].posterior.probability(points) > 0.5, parted.probability(points) > 0.5
    assert (one & parts).sum() / (one | parts).sum() > 0.9


@pytest.mark.parametrize("object_id", BOXES)
def test_a_lattice_is_that_of_its_points_where_it_counts(found, object_id):
    posterior = found[object_id].posterior
    axes = grid_axes(posterior.bounds, 0.01)
    volume = posterior.probability_volume(axes)
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    exact = posterior.probability(nodes.reshape(-1, 3)).reshape(volume.shape)
    assert (exact > 0.5).sum() > 50
    np.testing.assert_array_equal(volume > 0.5, exact > 0.5)
    np.testing.assert_allclose(volume[exact > 0.1], exact[exact > 0.1], atol=1e-6)
    assert (volume[exact < 0.02] < 0.1).all()
