import numpy as np

from brrp_cli.config import VPrismConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject
from brrp_cli.observation.scene_samples import FREE, sample_scene

CONFIG = VPrismConfig().observation
K = np.array([[150.0, 0, 80], [0, 150.0, 60], [0, 0, 1]])


def wall(segmap):
    """A wall 0.8 m ahead, with every masked pixel on slabs 0.7 m ahead."""
    depth = np.where(segmap > 0, 0.7, 0.8)
    rgb = np.zeros((*segmap.shape, 3), np.uint8)
    return Frame(rgb=rgb, points=backproject(depth, K), segmap=segmap, K=K)


def two_slabs_and_a_speck():
    segmap = np.zeros((120, 160), np.int64)
    segmap[50:70, 40:60] = 12
    segmap[50:70, 100:120] = 4
    segmap[0, :3] = 7
    return wall(segmap)


def test_labels_follow_the_ids_and_lie_where_they_say():
    scene = sample_scene(two_slabs_and_a_speck(), CONFIG, seed=0)
    assert list(scene.points) == [4, 12]
    assert scene.too_few == {7: 3}
    assert set(scene.labels) == {FREE, 1, 2}
    for label, (object_id, points) in enumerate(scene.points.items(), start=1):
        surface = scene.samples[scene.labels == label]
        assert 0 < len(surface) < len(points)
        np.testing.assert_allclose(surface[:, 2], 0.7, atol=1e-6)
        low, high = points.min(axis=0) - 1e-6, points.max(axis=0) + 1e-6
        assert ((surface >= low) & (surface <= high)).all()
        np.testing.assert_allclose(scene.centers[object_id], (low + high) / 2)


def test_free_samples_lie_before_the_surface_or_behind_the_plane_near_an_object():
    scene = sample_scene(two_slabs_and_a_speck(), CONFIG, seed=0)
    free = scene.samples[scene.labels == FREE]
    centers = np.array(list(scene.centers.values()))
    distance = np.linalg.norm(free[:, None] - centers[None], axis=-1).min(axis=1)
    assert distance.max() <= CONFIG.ray_radius + 0.02  # means of cells of 1.5 cm
    behind_a_slab = np.zeros(len(free), bool)
    for points in scene.points.values():
        low, high = (points[:, :2] / points[:, 2:]).min(0), (points[:, :2] / points[:, 2:]).max(0)
        seen = free[:, :2] / free[:, 2:]
        behind_a_slab |= ((seen > low) & (seen < high)).all(axis=1)
    hidden = (free[:, 2] > 0.71) & (free[:, 2] < 0.78) & behind_a_slab
    assert behind_a_slab.sum() > 100
    assert not hidden.any()
    assert (free[:, 2] > 0.8).any()  # below the plane, that is, behind the wall


def test_a_frame_without_objects_has_no_samples():
    scene = sample_scene(wall(np.zeros((120, 160), np.int64)), CONFIG, seed=0)
    assert scene.samples.shape == (0, 3)
    assert scene.labels.shape == (0,)
    assert not scene.points
