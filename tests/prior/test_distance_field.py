"""Fields of solids whose distance is known in closed form, and their way through a shard."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh
from stored_example import example, with_field

from brrp_cli.errors import PriorError
from brrp_cli.prior.distance_field import DistanceField, distance_field, quick_distance_field
from brrp_cli.prior.pack import pack, unpack
from brrp_cli.prior.parameters import FieldConfig
from brrp_cli.prior.shard import open_shard, read_stored, write_shard

CONFIG = FieldConfig(nodes=20_000)


def ball_distance(points):
    return np.linalg.norm(points, axis=1) - 0.9


def box_distance(points, half):
    beyond = np.abs(points) - half
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0)


def around(half, count=4000, seed=0):
    """Points in a box and up to 0.1 beyond it, where the grid is."""
    return np.random.default_rng(seed).uniform(-1, 1, (count, 3)) * (np.array(half) + 0.1)


@pytest.fixture(scope="module")
def ball():
    return distance_field(trimesh.creation.icosphere(subdivisions=4, radius=0.9), CONFIG)


@pytest.fixture(scope="module")
def plate():
    return distance_field(trimesh.creation.box((2.0, 1.2, 0.1)), CONFIG)


def test_the_field_of_a_ball_is_known_within_half_a_cell(ball):
    points = around([0.9] * 3)
    error = ball.signed_distance(points) - ball_distance(points)
    assert np.abs(error).max() < ball.spacing / 2
    assert (np.sign(ball.signed_distance(points)) == np.sign(ball_distance(points))).mean() > 0.98


@pytest.mark.parametrize("half", [(1.0, 0.6, 0.4), (1.0, 0.6, 0.05)])
def test_the_field_of_a_box_is_known_within_half_a_cell(half):
    field = distance_field(trimesh.creation.box(2 * np.array(half)), CONFIG)
    points = around(half)
    error = field.signed_distance(points) - box_distance(points, np.array(half))
    assert np.abs(error).max() < field.spacing / 2


def test_a_box_that_stands_askew_and_away_from_the_origin():
    """Axes, corner and sign of the grid: no symmetry hides a mistake."""
    half = np.array([0.5, 0.3, 0.2])
    T = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])
    T[:3, 3] = [0.4, -2.0, 1.0]
    mesh = trimesh.creation.box(2 * half)
    mesh.apply_transform(T)
    field = distance_field(mesh, CONFIG)
    local = around(half)
    points = local @ T[:3, :3].T + T[:3, 3]
    assert np.abs(field.signed_distance(points) - box_distance(local, half)).max() < (
        field.spacing / 2
    )


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.icosphere(subdivisions=4, radius=0.9),
        trimesh.creation.box((1.6, 1.0, 0.4)).subdivide_to_size(0.1),
        trimesh.creation.annulus(r_min=0.75, r_max=0.8, height=1.2, sections=64).subdivide_to_size(
            0.1
        ),
    ],
    ids=["ball", "box", "tube"],
)
def test_the_quick_field_is_the_same_near_the_surface_and_almost_so_beyond(mesh):
    field, quick = distance_field(mesh, CONFIG), quick_distance_field(mesh, CONFIG)
    np.testing.assert_array_equal(quick.lower, field.lower)
    np.testing.assert_array_equal(np.sign(quick.values), np.sign(field.values))
    more = np.abs(quick.values) - np.abs(field.values)
    near = np.abs(field.values) < 1.5 * field.spacing
    assert 0.05 < near.mean() < 0.9
    # A point of the surface that is found on another way differs in its last bit.
    assert np.abs(more[near]).max() < 1e-3 * field.spacing
    assert more.min() > -1e-3 * field.spacing
    assert more.max() < field.spacing / 2


def test_faces_that_are_wider_than_nodes_make_no_difference():
    mesh = trimesh.creation.box((1.6, 1.0, 0.4))
    np.testing.assert_array_equal(
        quick_distance_field(mesh, CONFIG).values, distance_field(mesh, CONFIG).values
    )


def test_off_the_lattice_the_distance_is_never_too_small_and_grows(ball, plate):
    """The way to the grid and on from there is no shorter than the way, and at most twice."""
    direction = np.random.default_rng(1).normal(size=(500, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    for field, distance in (
        (ball, ball_distance),
        (plate, lambda points: box_distance(points, np.array([1.0, 0.6, 0.05]))),
    ):
        for far in (2.0, 5.0, 50.0):
            found, true = field.signed_distance(far * direction), distance(far * direction)
            assert (found > true - field.spacing / 2).all()
            assert (found < 2 * true).all()
        # Far away the size of the object counts no more.
        assert np.abs(found / true - 1).max() < 0.05


def test_a_flat_object_gets_a_finer_lattice_of_as_many_nodes(ball, plate):
    assert plate.spacing < 0.6 * ball.spacing
    assert plate.spacing < 0.1, "a plate of 0.1 is not lost between two nodes"
    for field in (ball, plate):
        assert 0.9 * CONFIG.nodes < field.values.size < 1.5 * CONFIG.nodes


def test_the_lattice_covers_the_box_and_its_margin(plate):
    upper = plate.lower + plate.spacing * (np.array(plate.values.shape) - 1)
    assert (plate.lower <= [-1.1, -0.7, -0.15]).all() and (upper >= [1.1, 0.7, 0.15]).all()


def test_at_the_nodes_the_values_stand_as_they_are():
    values = np.random.default_rng(0).normal(size=(3, 4, 5)).astype(np.float32)
    field = DistanceField(np.array([1.0, 2.0, 3.0]), 0.5, values)
    assert field.signed_distance(np.array([[1.5, 3.5, 4.0]]))[0] == pytest.approx(values[1, 3, 2])
    between = field.signed_distance(np.array([[1.25, 2.0, 3.0]]))[0]
    assert between == pytest.approx((values[0, 0, 0] + values[1, 0, 0]) / 2)
    beside = field.signed_distance(np.array([[1.0, 2.0, 2.4]]))[0]
    assert beside == pytest.approx(values[0, 0, 0] + 0.6)


@pytest.fixture
def shard(tmp_path: Path, plate: DistanceField) -> Path:
    write_shard(tmp_path / "shard.h5", [pack(with_field(example(), plate), "aa")], {})
    return tmp_path / "shard.h5"


def test_a_shard_gives_the_field_back_as_it_was(shard, plate):
    with open_shard(shard) as file:
        found = unpack(read_stored(file, "cup"), "a cup").shape.field
    np.testing.assert_array_equal(found.lower, plate.lower)
    assert found.spacing == plate.spacing
    np.testing.assert_array_equal(found.values, plate.values)
    assert found.values.dtype == plate.values.dtype
    points = around([1.0, 0.6, 0.05])
    np.testing.assert_array_equal(found.signed_distance(points), plate.signed_distance(points))


def truncated(group):
    values = group["values"][1:]
    del group["values"]
    group.create_dataset("values", data=values, chunks=True, fletcher32=True)


def bombed(group):
    """A few bytes that call themselves a billion nodes."""
    del group["values"]
    options = {"chunks": (64, 64, 64), "fletcher32": True, "compression": "gzip"}
    group.create_dataset("values", (1000, 1000, 1000), "<f2", **options)


def flat(group):
    del group["values"]
    group.create_dataset("values", data=np.zeros((2, 8), np.float16), chunks=True, fletcher32=True)


def unbounded(group):
    values = group["values"][...]
    values[0, 0, 0] = np.inf
    group["values"][...] = values


def wider(group):
    group["spacing"][...] = 1.0


def dropped(group):
    del group["lower"]


def gone(group):
    parent = group.parent
    del parent["distances"]


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (truncated, "checksum"),
        (bombed, "1000, 1000, 1000"),
        (flat, "(2, 8)"),
        (unbounded, "NaN or infinite"),
        (wider, "checksum"),
        (dropped, "no data set distances/lower"),
        (gone, "no data set distances/lower"),
    ],
)
def test_damaged_distances_are_refused(shard, damage, told):
    with h5py.File(shard, "r+") as file:
        damage(file["objects/cup/distances"])
    with pytest.raises(PriorError, match="damaged") as caught, open_shard(shard) as file:
        read_stored(file, "cup")
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("spacing", "shape"), [(0.0, (3, 3, 3)), (-0.1, (3, 3, 3)), (0.1, (3, 1, 3))]
)
def test_a_field_that_is_no_lattice_is_refused_though_its_checksum_is_right(
    tmp_path, spacing, shape
):
    field = DistanceField(np.zeros(3), spacing, np.zeros(shape, np.float32))
    write_shard(tmp_path / "bad.h5", [pack(with_field(example(), field), "aa")], {})
    with (
        pytest.raises(PriorError, match="without a grid"),
        open_shard(tmp_path / "bad.h5") as file,
    ):
        read_stored(file, "cup")
