import h5py
import numpy as np
import pytest
from eight_objects import MESHES
from training.examples import Recipe, make_examples, read_examples, scene_examples

from brrp_cli.errors import BrrpError
from brrp_cli.geometry import transform_points
from brrp_cli.raycast import inside, raycasting_scene

RECIPE = Recipe(truth="exact", points=64, queries=256)


@pytest.fixture(scope="module")
def found(place):
    return scene_examples(place.scenes[0], place.folder, RECIPE, place.folder / "cache")


def make(place, output, recipe=RECIPE):
    cache = place.folder / "cache"
    return list(make_examples(place.scenes, place.folder, recipe, output, cache))


def test_every_object_that_is_seen_is_an_example(found):
    assert found.names == list(MESHES)
    assert found.clouds.shape == (8, 64, 3) and found.queries.shape == (8, 256, 3)


def test_clouds_and_labels_lie_where_the_object_is(place, found):
    scene = place.scenes[0]
    frame = scene.view(0)
    for i, name in enumerate(found.names):
        points = frame.object_points(i + 1)
        center = (points.min(axis=0) + points.max(axis=0)) / 2
        T_object_world = np.linalg.inv(scene.object(i + 1).T_world_object)
        T_object_cam = T_object_world @ frame.T_world_cam
        mesh = MESHES[name]

        cloud = found.clouds[i].astype(float) * RECIPE.scale
        np.testing.assert_allclose(cloud.min(axis=0) + cloud.max(axis=0), 0, atol=0.02)
        seen = transform_points(T_object_cam, cloud + center).astype(np.float32)
        off = raycasting_scene([mesh]).compute_distance(seen).numpy()
        assert off.max() < 5e-4, name

        asked = transform_points(T_object_cam, found.queries[i].astype(float) * 0.15 + center)
        assert (inside(mesh, asked) == found.labels[i]).mean() > 0.99, name


def test_what_is_there_is_not_made_again(place, tmp_path):
    paths = make(place, tmp_path)
    before = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in paths}
    paths[1].unlink()
    assert make(place, tmp_path) == paths
    assert paths[0].stat().st_mtime_ns == before[paths[0]][0]
    assert paths[1].read_bytes() == before[paths[1]][1]


def test_examples_come_back_as_they_went(place, found, tmp_path):
    read = read_examples(make(place, tmp_path), RECIPE)
    assert len(read) == 16 and read.names == [*MESHES] * 2
    np.testing.assert_array_equal(read.clouds[:8], found.clouds)
    np.testing.assert_array_equal(read.queries[:8], found.queries)
    np.testing.assert_array_equal(read.labels[:8], found.labels)


def test_examples_of_another_recipe_are_refused(place, tmp_path):
    make(place, tmp_path)
    other = Recipe(truth="exact", points=64, queries=256, seed=1)
    with pytest.raises(BrrpError, match="another way"):
        make(place, tmp_path, other)
    with pytest.raises(BrrpError, match="another way"):
        read_examples(sorted(tmp_path.glob("*.h5")), other)


def test_a_damaged_file_is_told(place, tmp_path):
    paths = make(place, tmp_path)
    data = paths[0].read_bytes()
    paths[0].write_bytes(data[: len(data) // 2])
    with pytest.raises(BrrpError, match="cannot be read"):
        read_examples(paths, RECIPE)
    # A bit that flipped in the numbers themselves.
    with h5py.File(paths[1]) as file:
        where = file["queries"].id.get_chunk_info(0).byte_offset
    damaged = bytearray(paths[1].read_bytes())
    damaged[where + 100] ^= 1
    paths[1].write_bytes(damaged)
    with pytest.raises(BrrpError, match="cannot be read"):
        read_examples(paths[1:], RECIPE)
