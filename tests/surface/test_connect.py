"""One piece of a level set: known volumes on a grid."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from skimage.measure import label, marching_cubes

from brrp_cli.config import PRESETS, PointSDFConfig, SurfaceConfig, VPrismConfig
from brrp_cli.surface.connect import one_piece
from brrp_cli.surface.extract import level_set

SPACING = 0.003
SHAPE = (40, 30, 30)
CONFIG = SurfaceConfig()
LEFT, RIGHT = np.s_[5:13, 10:20, 10:20], np.s_[25:33, 10:20, 10:20]


def faces(*boxes):
    """Observed points, in nodes, on the z-lowest face of each box."""
    found = []
    for x, y, z in boxes:
        u, v = np.meshgrid(np.arange(x.start, x.stop), np.arange(y.start, y.stop))
        found.append(np.stack([u.ravel(), v.ravel(), np.full(u.size, z.start)], axis=1))
    return np.concatenate(found).astype(float)


def two_boxes(between=0.05):
    volume = np.full(SHAPE, 0.01)
    volume[13:25, 14:16, 14:16] = between
    volume[LEFT] = volume[RIGHT] = 0.95
    return volume


def pieces(region):
    return int(label(region, connectivity=1).max())


def test_a_single_part_is_what_it_is():
    volume = np.full(SHAPE, 0.01)
    volume[LEFT] = 0.9
    kept = one_piece(volume, 0.5, faces(LEFT), SPACING, CONFIG)
    assert (kept == (volume >= 0.5)).all()


def test_two_seen_parts_become_one_along_the_most_probable_way():
    volume = np.full(SHAPE, 0.01)
    volume[LEFT] = volume[RIGHT] = 0.95
    # The way round is probable, the straight one is not.
    volume[10:12, 2:10, 14:16] = volume[10:27, 2:4, 14:16] = volume[26:28, 2:10, 14:16] = 0.4
    kept = one_piece(volume, 0.5, faces(LEFT, RIGHT), SPACING, CONFIG)
    assert kept[LEFT].all() and kept[RIGHT].all()
    assert pieces(kept) == 1
    assert kept[18, 2:4, 14:16].any()
    assert not kept[18, 10:20].any()


def test_the_joint_is_thin():
    volume = two_boxes()
    kept = one_piece(volume, 0.5, faces(LEFT, RIGHT), SPACING, CONFIG)
    joint = kept & ~(volume >= 0.5)
    across = joint[13:25].sum(axis=(1, 2))
    assert (across >= 1).all() and (across <= 9).all()


def test_the_mesh_of_two_parts_is_closed_and_in_one_piece():
    axes = tuple(np.arange(n) * SPACING for n in SHAPE)
    observed = faces(LEFT, RIGHT) * SPACING
    found = level_set(two_boxes(), axes, observed, 0.5, CONFIG)
    mesh = trimesh.Trimesh(found.vertices, found.faces)
    assert mesh.is_volume
    assert mesh.body_count == 1


@pytest.mark.parametrize("dropped", [0, 3])
def test_a_part_that_few_points_are_near_is_dropped(dropped):
    """With 3 of 323 points or none on it, it is a phantom: they are fewer than the share that
    counts."""
    volume = two_boxes()
    volume[RIGHT] = 0.01
    phantom = np.s_[25:28, 10:13, 10:13]
    volume[phantom] = 0.9
    observed = np.concatenate([faces(LEFT)] * 4 + [faces(phantom)[:dropped]])
    kept = one_piece(volume, 0.5, observed, SPACING, CONFIG)
    assert kept[LEFT].all() and not kept[phantom].any()
    assert pieces(kept) == 1


def test_a_bulky_part_needs_fewer_points():
    volume = two_boxes()
    observed = np.concatenate([faces(LEFT)] * 6 + [faces(RIGHT)[:4]])
    assert 4 / len(observed) < CONFIG.seen_share
    kept = one_piece(volume, 0.5, observed, SPACING, CONFIG)
    assert kept[LEFT].all() and kept[RIGHT].all()


def test_the_seen_part_is_kept_however_large_the_unseen_one():
    volume = two_boxes()
    volume[25:38, 2:28, 2:28] = 0.95
    kept = one_piece(volume, 0.5, faces(LEFT), SPACING, CONFIG)
    assert kept[LEFT].all() and not kept[25:38].any()


def test_parts_that_touch_at_a_corner_are_joined():
    volume = np.full(SHAPE, 0.01)
    other = np.s_[13:21, 20:28, 20:28]
    volume[LEFT] = volume[other] = 0.9
    assert pieces(volume >= 0.5) == 2
    kept = one_piece(volume, 0.5, faces(LEFT, other), SPACING, CONFIG)
    assert pieces(kept) == 1
    vertices, triangles, _, _ = marching_cubes(np.pad(np.where(kept, 0.9, 0.0), 1), 0.5)
    assert trimesh.Trimesh(vertices, triangles).body_count == 1


def test_cavities_are_filled_and_hollows_stay_open():
    volume = np.full(SHAPE, 0.01)
    volume[LEFT] = 0.9
    volume[7:11, 13:17, 13:17] = 0.1  # nobody can see into it
    volume[9, 14:16, 10:12] = 0.1  # open at the face
    kept = one_piece(volume, 0.5, faces(LEFT), SPACING, CONFIG)
    assert kept[7:11, 13:17, 13:17].all()
    assert not kept[9, 14:16, 10:12].any()


def test_nothing_near_the_observed_points_is_nothing():
    far = faces(LEFT) + [0, 0, -9]
    assert not one_piece(two_boxes(), 0.5, far + [0, 0, -9], SPACING, CONFIG).any()
    assert not one_piece(two_boxes(), 0.5, np.zeros((0, 3)), SPACING, CONFIG).any()


def test_the_published_methods_keep_every_part_near_what_was_seen():
    volume = two_boxes()
    volume[2:4, 2:4, 25:28] = 0.95
    observed = np.concatenate([faces(LEFT), faces(RIGHT)])
    axes = tuple(SPACING * np.arange(n) for n in volume.shape)
    config = replace(CONFIG, one_piece=False)
    found = level_set(volume, axes, observed * SPACING, 0.5, config)
    assert found is not None
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    # Both boxes, apart, and not the crumb that nobody saw.
    assert len(mesh.split()) == 2
    for preset in (PRESETS["paper"], VPrismConfig(), PointSDFConfig()):
        assert not preset.surface.one_piece
