"""Colours of a mesh's vertices from a texture that is finer than its faces."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from brrp_cli.prior.build.coloured_mesh import Paint, PaintedMesh
from brrp_cli.prior.build.vertex_colours import colours_at, places_within, vertex_colours
from brrp_cli.prior.parameters import ColoursConfig

CONFIG = ColoursConfig()


def square(image):
    """A square of 1 m at z = 0 with an image on it, x along its columns, y up."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    uv = corners[mesh.faces][..., :2].astype(np.float32)
    return PaintedMesh(((mesh, Paint(uv=uv, image=image)),))


def cut_square(parts):
    """Vertices and faces of the same square, cut into `parts` by `parts`."""
    x, y = np.meshgrid(*2 * [np.linspace(0, 1, parts + 1)])
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    first = (np.arange(parts)[:, None] * (parts + 1) + np.arange(parts)).ravel()
    right, up, across = first + 1, first + parts + 1, first + parts + 2
    faces = np.concatenate([np.stack([first, right, across], 1), np.stack([first, across, up], 1)])
    return vertices, faces


@pytest.mark.parametrize("cuts", [1, 2, 3, 5])
def test_places_are_spread_evenly_over_a_triangle(cuts):
    places = places_within(cuts)
    assert places.shape == (cuts**2, 3)
    assert (places > 0).all()
    np.testing.assert_allclose(places.sum(axis=1), 1)
    np.testing.assert_allclose(places.mean(axis=0), 1 / 3)


def test_a_texture_finer_than_the_faces_becomes_its_mean():
    """A chequerboard of single pixels: at the vertices alone it is black or white."""
    chequers = 255 * (np.indices((512, 512)).sum(axis=0) % 2).astype(np.uint8)
    painted = square(np.repeat(chequers[..., None], 3, axis=-1))
    vertices, faces = cut_square(25)
    vertices += [0.0007, 0.0003, 0]
    assert set(np.unique(colours_at(painted, vertices))) == {0, 255}
    found = vertex_colours(painted, vertices, faces, ColoursConfig(cuts=8, steps=1))
    inner = (np.abs(vertices[:, :2] - 0.5) < 0.45).all(axis=1)
    assert np.abs(found[inner].astype(float) - 127.5).max() < 45
    assert found[inner].mean() == pytest.approx(127.5, abs=3)


def test_colours_that_grow_evenly_stay():
    """Red grows along x, green along y."""
    grow = np.arange(256, dtype=np.uint8)
    image = np.stack(np.broadcast_arrays(grow, grow[::-1, None], 7), axis=-1).astype(np.uint8)
    vertices, faces = cut_square(4)
    found = vertex_colours(square(image), vertices, faces, ColoursConfig(steps=200))
    expected = np.column_stack([255 * vertices[:, :2], np.full(len(vertices), 7)])
    np.testing.assert_allclose(found, expected, atol=2)


def test_they_are_the_least_squares_fit_to_the_texture():
    rng = np.random.default_rng(0)
    letters = rng.integers(60, 190, (16, 16)).astype(np.uint8)
    image = np.asarray(Image.fromarray(letters).resize((512, 512), Image.Resampling.BICUBIC))
    painted = square(np.repeat(image[..., None], 3, axis=-1))
    vertices, faces = cut_square(10)
    inside = places_within(4)
    places = np.einsum("kc,fcj->fkj", inside, vertices[faces]).reshape(-1, 3)
    texture = colours_at(painted, places)[:, 0].astype(float)
    blend = np.zeros((len(places), len(vertices)))
    for row in range(len(places)):
        blend[row, faces[row // len(inside)]] = inside[row % len(inside)]
    best = np.linalg.lstsq(blend, texture, rcond=None)[0]
    found = vertex_colours(painted, vertices, faces, ColoursConfig(cuts=4, steps=500))[:, 0]
    np.testing.assert_allclose(found, best, atol=1)
    # A few steps do most of it.
    few = vertex_colours(painted, vertices, faces, ColoursConfig(cuts=4))[:, 0]
    off = [np.square(blend @ each.astype(float) - texture).sum() for each in (found, few)]
    alone = colours_at(painted, vertices)[:, 0].astype(float)
    assert off[0] <= off[1] < off[0] + 0.1 * (np.square(blend @ alone - texture).sum() - off[0])


def test_without_a_texture_a_vertex_has_the_colour_of_its_place():
    vertices, faces = cut_square(3)
    corners = np.random.default_rng(1).integers(0, 255, (2, 3, 3)).astype(np.float32)
    painted = PaintedMesh(
        ((trimesh.Trimesh(*cut_square(1), process=False), Paint(corners=corners)),)
    )
    found = vertex_colours(painted, vertices, faces, CONFIG)
    np.testing.assert_array_equal(found, colours_at(painted, vertices))


def test_a_vertex_of_no_face_has_the_colour_of_its_place():
    image = np.full((8, 8, 3), [10, 20, 30], np.uint8)
    vertices, faces = cut_square(2)
    alone = np.concatenate([vertices, [[0.5, 0.5, 0.2]]])
    found = vertex_colours(square(image), alone, faces, CONFIG)
    np.testing.assert_array_equal(found, np.tile([10, 20, 30], (len(alone), 1)))


def test_the_same_colours_every_time():
    image = np.random.default_rng(2).integers(0, 255, (64, 64, 3)).astype(np.uint8)
    vertices, faces = cut_square(9)
    once = vertex_colours(square(image), vertices, faces, CONFIG)
    np.testing.assert_array_equal(once, vertex_colours(square(image), vertices, faces, CONFIG))
