"""Meshes of made scenes as they are drawn."""

import numpy as np
import trimesh
from tabletop.models import load_model


def test_plain_colours_of_faces_are_drawn(tmp_path):
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    box.visual.face_colors = [[255, 0, 0, 255]] * 6 + [[0, 0, 255, 255]] * 6
    box.export(tmp_path / "two.ply")
    box.export(tmp_path / "none.stl")
    model = load_model(tmp_path / "two.ply")
    texture = np.asarray(model.texture)
    columns = (model.uv[model.faces][..., 0] * texture.shape[1]).astype(int)
    drawn = texture[texture.shape[0] // 2, columns]
    assert (drawn == drawn[:, :1]).all()
    assert sorted(map(tuple, drawn[:, 0])) == [(0, 0, 255)] * 6 + [(255, 0, 0)] * 6
    # The same faces with the same normals, each with corners of its own.
    assert np.allclose(model.vertices[model.faces], box.triangles, atol=1e-6)
    assert load_model(tmp_path / "none.stl").uv is None


def test_as_many_colours_are_drawn_as_vertices_have(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    places = ball.vertices / 0.1 + 0.5
    ball.visual.vertex_colors = np.c_[255 * places, np.full(len(places), 255)].astype(np.uint8)
    ball.export(tmp_path / "ball.ply")
    model = load_model(tmp_path / "ball.ply")
    texture = np.asarray(model.texture)
    corners = model.uv[model.faces].mean(axis=1)
    column = (corners[:, 0] * texture.shape[1]).astype(int)
    row = ((1 - corners[:, 1]) * texture.shape[0]).astype(int)
    middles = model.vertices[model.faces].mean(axis=1) / 0.1 + 0.5
    assert len(np.unique(texture[row, column], axis=0)) > 2000
    np.testing.assert_allclose(texture[row, column], 255 * middles, atol=8)
