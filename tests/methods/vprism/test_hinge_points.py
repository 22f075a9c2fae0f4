import numpy as np

from brrp_cli.methods.vprism.hinge_points import scene_hinges


def hinges(points, centers, seed=0):
    return scene_hinges(points, centers, spacing=0.05, radius=0.15, surface=32, seed=seed)


def test_one_object_has_the_grid_points_of_a_ball_and_its_own():
    cloud = np.random.default_rng(0).normal(scale=0.02, size=(500, 3)).astype(np.float32)
    found = hinges({4: cloud}, {4: np.zeros(3)})
    # Integer points with |x|^2 <= 9: 123 of them; floats may drop some of the 30 on the sphere.
    assert 93 <= len(found) - 32 <= 123
    assert np.linalg.norm(found[:-32], axis=1).max() <= 0.15
    surface = {tuple(p) for p in cloud.astype(np.float64)}
    assert len({tuple(p) for p in found[-32:]} & surface) == 32


def test_objects_that_share_space_share_the_grid():
    cloud = np.zeros((5, 3), np.float32)
    near, far = np.array([0.05, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    apart = len(hinges({1: cloud, 2: cloud}, {1: np.zeros(3), 2: far}))
    together = len(hinges({1: cloud, 2: cloud}, {1: np.zeros(3), 2: near}))
    assert together < 0.75 * apart


def test_a_small_object_gives_all_its_points():
    cloud = np.arange(60, dtype=np.float32).reshape(20, 3) / 1000
    found = hinges({1: cloud}, {1: np.zeros(3)})
    assert {tuple(p) for p in found[-20:]} == {tuple(p) for p in cloud.astype(np.float64)}
