import numpy as np

from brrp_cli.evaluation.perturb import shift_masks, with_noise
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject

K = np.array([[100.0, 0, 20], [0, 100.0, 15], [0, 0, 1]])


def frame():
    segmap = np.zeros((30, 40), dtype=np.int64)
    segmap[10:20, 5:12] = 3
    depth = np.full((30, 40), 0.9)
    depth[:3] = 0
    rgb = np.zeros((30, 40, 3), np.uint8)
    return Frame(rgb, backproject(depth, K), segmap, K)


def test_masks_move_and_depth_does_not():
    before = frame()
    for pixels, columns in ((2, slice(7, 14)), (-5, slice(0, 7)), (-8, slice(0, 4))):
        after = shift_masks(before, pixels)
        expected = np.zeros_like(before.segmap)
        expected[10:20, columns] = 3
        np.testing.assert_array_equal(after.segmap, expected)
        np.testing.assert_array_equal(after.points, before.points)
    assert shift_masks(before, 0) is before


def test_noise_moves_points_along_their_rays_by_millimetres():
    before = frame()
    one, same, other = (with_noise(before, np.random.default_rng(s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.points, same.points)
    assert not np.array_equal(one.points, other.points, equal_nan=True)
    both = before.valid & one.valid
    error = one.points[both][:, 2] - 0.9
    assert 0.0005 < np.abs(error).mean() < 0.005
    assert not one.valid[:3].any()
