import numpy as np
from brrp_cli.registration.alignment_score import contradicted, explained

from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject

K = np.array([[100.0, 0, 50], [0, 100, 40], [0, 0, 1]])


def wall(distance=1.0):
    depth = np.full((80, 100), distance)
    return Frame(
        rgb=np.zeros((80, 100, 3), np.uint8),
        points=backproject(depth, K),
        segmap=np.zeros((80, 100), np.int64),
        K=K,
    )


def test_explained_counts_the_points_near_the_model():
    model = np.array([[0.0, 0, 1], [0.1, 0, 1]])
    observed = np.array([[0.0, 0.004, 1], [0.1, 0, 1.006], [0.05, 0, 1], [0, 0, 2]])
    assert explained(observed, model, 0.005) == 0.25
    assert explained(observed, model, 0.0075) == 0.5


def test_contradicted_counts_the_model_in_front_of_what_was_seen():
    model = np.array([[0.0, 0, 0.9], [0, 0, 0.995], [0, 0, 1.2], [0.1, 0.1, 0.5]])
    assert contradicted(model, wall(), 0.0075) == 0.5


def test_points_that_the_image_does_not_show_say_nothing():
    outside, behind_camera = [10.0, 0, 0.5], [0.0, 0, -0.5]
    assert contradicted(np.array([outside, behind_camera]), wall(), 0.0075) == 0


def test_pixels_without_a_return_say_nothing():
    assert contradicted(np.array([[0.0, 0, 0.5]]), wall(np.nan), 0.0075) == 0
