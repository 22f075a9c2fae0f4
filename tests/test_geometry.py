import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from brrp_cli.errors import BrrpError
from brrp_cli.geometry import (
    as_points,
    backproject,
    bounds,
    cells_of,
    normalise,
    project,
    rotation_angle,
    similarity,
    transform_points,
    within,
)

K = np.array([[600.0, 0, 315.5], [0, 610.0, 243.25], [0, 0, 1]])


def test_backprojected_pixels_project_back_to_themselves() -> None:
    depth = np.random.default_rng(0).uniform(0.3, 3, (48, 64))
    points = backproject(depth, K)
    assert points.dtype == np.float32
    assert np.allclose(points[..., 2], depth)
    v, u = np.mgrid[:48, :64]
    uv = project(points.reshape(-1, 3).astype(np.float64), K)
    assert np.allclose(uv, np.stack([u, v], axis=-1).reshape(-1, 2), atol=1e-3)


def test_a_pixel_right_of_and_below_the_centre_has_positive_x_and_y() -> None:
    depth = np.zeros((480, 640))
    depth[400, 600] = 2.0
    x, y, z = backproject(depth, K)[400, 600]
    assert np.allclose([x, y, z], [(600 - 315.5) / 300, (400 - 243.25) / 305, 2])


def test_pixels_without_depth_are_nan() -> None:
    depth = np.array([[0.0, -1.0, np.nan], [np.inf, -np.inf, 1.0]])
    assert np.isnan(backproject(depth, K)).all(axis=-1).tolist() == [
        [True, True, True],
        [True, True, False],
    ]


def test_similarity_scales_then_rotates_then_moves() -> None:
    quarter_turn = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    T = similarity(2.0, quarter_turn, np.array([10.0, 20, 30]))
    assert np.allclose(
        transform_points(T, np.array([[1.0, 0, 0], [0, 0, 1]])), [[10, 22, 30], [10, 20, 32]]
    )


def test_a_transform_and_its_inverse_cancel() -> None:
    rng = np.random.default_rng(1)
    T = similarity(0.37, Rotation.random(random_state=2).as_matrix(), rng.normal(size=3))
    points = rng.normal(size=(5, 7, 3))
    there = transform_points(T, points)
    assert there.shape == points.shape
    assert np.allclose(transform_points(np.linalg.inv(T), there), points)


def test_transforms_compose_by_their_names() -> None:
    rng = np.random.default_rng(3)
    T_world_cam = similarity(rotation=Rotation.random(random_state=4).as_matrix())
    T_cam_object = similarity(0.5, translation=rng.normal(size=3))
    points = rng.normal(size=(6, 3))
    assert np.allclose(
        transform_points(T_world_cam @ T_cam_object, points),
        transform_points(T_world_cam, transform_points(T_cam_object, points)),
    )


def test_the_default_similarity_is_the_identity() -> None:
    assert np.array_equal(similarity(), np.eye(4))


def test_normalise_gives_unit_vectors_and_keeps_zeros() -> None:
    assert np.allclose(normalise(np.array([[3.0, 0, 4], [0, 0, 0]])), [[0.6, 0, 0.8], [0, 0, 0]])


def test_bounds_are_the_least_and_the_greatest_of_each_coordinate() -> None:
    points = np.array([[1.0, -2.0, 0.5], [3.0, 4.0, 0.5], [2.0, 0.0, -1.0]], np.float32)
    least, most = bounds(points)
    assert least.dtype == most.dtype == np.float32
    assert least.tolist() == [1.0, -2.0, -1.0] and most.tolist() == [3.0, 4.0, 0.5]
    assert within(points, np.array([1.0, -2.0, -1.0]), np.array([2.0, 4.0, 1.0])).tolist() == [
        True,
        False,
        True,
    ]
    assert not within(np.full((1, 2), np.nan), np.zeros(2), np.ones(2)).any()


@pytest.mark.parametrize("cell", [0.5, 1e-4])  # counted, and sorted
def test_points_of_one_cell_have_one_number(cell: float) -> None:
    points = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    cells = [tuple(each) for each in np.floor(points / cell).astype(int).tolist()]
    numbers = {each: number for number, each in enumerate(sorted(set(cells)))}
    assert cells_of(points, cell).tolist() == [numbers[each] for each in cells]


@pytest.mark.parametrize("degrees", [0.0, 1e-3, 30.0, 90.0, 180.0])
def test_a_rotation_turns_by_its_angle(degrees):
    axis = np.array([1.0, -2.0, 0.5])
    turn = Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis)).as_matrix()
    assert np.degrees(rotation_angle(turn)) == pytest.approx(degrees, abs=1e-5)


@pytest.mark.parametrize("points", [[[1, 2, 3]], np.zeros((0, 3)), np.ones((4, 3), np.float32)])
def test_points_stay_what_they_are(points) -> None:
    np.testing.assert_array_equal(as_points(points), points)


@pytest.mark.parametrize(
    ("points", "told"),
    [
        ([1, 2], r"\(2,\)(.|\n)*\[\[x, y, z\], \.\.\.\]"),
        ([1, 2, 3], r"\(3,\)(.|\n)*one point as \[\[x, y, z\]\]"),
        (np.zeros((2, 3, 3)), r"\(2, 3, 3\)"),
        ([[1, 2, 3], [4, 5]], "no array of numbers"),
        ([["a", "b", "c"]], "no array of numbers"),
        (None, "no array of numbers"),
    ],
)
def test_what_are_no_points_is_told(points, told) -> None:
    with pytest.raises(BrrpError, match=told):
        as_points(points)
