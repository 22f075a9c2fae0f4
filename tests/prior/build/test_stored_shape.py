"""The mesh that a prior keeps: the same closed surface, fine enough, with its colours."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from closed_shapes import cup
from PIL import Image

from brrp_cli.geometry import similarity, transform_points
from brrp_cli.prior.build.coloured_mesh import load_painted, unpainted
from brrp_cli.prior.build.find_meshes import MeshSource
from brrp_cli.prior.build.make_object import make_object
from brrp_cli.prior.build.stored_shape import stored_shape, subdivided
from brrp_cli.prior.build.vertex_colours import GREY, colours_at
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters, FieldConfig, MeshConfig


def box():
    return trimesh.creation.box((2.0, 1.2, 0.1))


def longest_edge(vertices, faces):
    corners = vertices[faces]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()


@pytest.mark.parametrize("make", [box, cup], ids=["box", "cup"])
def test_a_subdivided_mesh_is_closed_and_the_same_surface(make):
    mesh = make()
    vertices, faces = subdivided(mesh.vertices, mesh.faces, MeshConfig(edge=0.1))
    fine = trimesh.Trimesh(vertices, faces, process=False)
    assert fine.is_watertight and fine.is_winding_consistent
    assert fine.volume == pytest.approx(mesh.volume, rel=1e-9)
    assert fine.area == pytest.approx(mesh.area, rel=1e-9)
    np.testing.assert_allclose(fine.bounds, mesh.bounds, atol=1e-12)
    assert longest_edge(vertices, faces) <= 0.1 * mesh.extents.max() / 2 or len(faces) > 10_000
    assert len(faces) <= 40_000
    # Every corner is still there, and every new one lies on a face of the old mesh.
    assert set(map(tuple, mesh.vertices.round(9))) <= set(map(tuple, vertices.round(9)))
    # Open3D's distances are of single precision.
    assert np.abs(distance_to(mesh, vertices)).max() < 1e-5 * mesh.extents.max()


def distance_to(mesh, points):
    from brrp_cli.raycast import raycasting_scene

    return raycasting_scene([mesh]).compute_distance(points.astype(np.float32)).numpy()


def test_no_more_faces_than_allowed():
    mesh = box()
    _, faces = subdivided(mesh.vertices, mesh.faces, MeshConfig(edge=0.001, faces=1000))
    assert 250 < len(faces) <= 1000
    _, kept = subdivided(mesh.vertices, mesh.faces, MeshConfig(edge=0.001, faces=47))
    np.testing.assert_array_equal(kept, mesh.faces)


def test_an_object_made_from_a_file_keeps_its_size_and_its_place(tmp_path):
    """Points of the stored surface lie on the stored mesh, in the same normalised frame."""
    mesh = cup()
    mesh.apply_translation([3.0, -2.0, 0.5])
    mesh.export(tmp_path / "cup.ply")
    parameters = BuildParameters(
        samples=100,
        dense_points=2000,
        surface_points=300,
        appearance=AppearanceConfig(views=1, rays=50),
        distances=FieldConfig(nodes=4000),
    )
    item = make_object(MeshSource("cup", tmp_path / "cup.ply", "cup.ply"), parameters)
    shape = item.shape
    np.testing.assert_allclose(np.ptp(shape.vertices, axis=0).max(), 2, rtol=1e-6)
    in_file = shape.vertices * item.half_extent + item.center
    np.testing.assert_allclose([in_file.min(axis=0), in_file.max(axis=0)], mesh.bounds, atol=1e-6)
    assert np.abs(shape.signed_distance(item.surface, 0.1)).max() < 1e-5
    closed = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    assert closed.is_watertight
    assert closed.volume * item.half_extent**3 == pytest.approx(mesh.volume, rel=1e-4)
    assert (shape.colours == GREY).all()


def painted(path, mesh):
    mesh.export(path)
    return load_painted(path)


def middles(mesh):
    return mesh.triangles_center


def test_vertex_colours_are_blended_between_the_corners(tmp_path):
    mesh = trimesh.creation.box((0.1, 0.1, 0.1))
    # Red grows along x, green along y.
    rgb = np.column_stack([255 * (mesh.vertices[:, :2] > 0), np.zeros(8)]).astype(np.uint8)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=rgb)
    points = np.array([[-0.05, 0.02, 0.0], [0.0, -0.05, 0.0], [0.05, 0.05, 0.05], [0.025, 0, 0.05]])
    found = colours_at(painted(tmp_path / "a.ply", mesh), points).astype(float)
    expected = np.column_stack([255 * (points[:, :2] / 0.1 + 0.5), np.zeros(4)])
    np.testing.assert_allclose(found, expected, atol=1)


def textured(image):
    """A square of 1 m at z = 0 with an image on it, x along its columns, y up."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    visual = trimesh.visual.TextureVisuals(uv=vertices[:, :2], image=image)
    return trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)


def test_a_texture_is_asked_where_the_point_is(tmp_path):
    pixels = np.zeros((4, 4, 3), np.uint8)
    pixels[:2, :2], pixels[:2, 2:] = [255, 0, 0], [0, 255, 0]
    pixels[2:, :2], pixels[2:, 2:] = [0, 0, 255], [9, 80, 200]
    found = colours_at(
        painted(tmp_path / "a.glb", textured(Image.fromarray(pixels))),
        # The image's first row is the top.
        np.array([[0.2, 0.8, 0.01], [0.8, 0.8, -0.01], [0.3, 0.1, 0.0], [0.9, 0.2, 0.0]]),
    )
    expected = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 80, 200]]
    np.testing.assert_array_equal(found, expected)


def test_a_plain_material_is_the_colour_of_all_of_it(tmp_path):
    mesh = trimesh.creation.box((0.1, 0.1, 0.1))
    material = trimesh.visual.material.SimpleMaterial(diffuse=[10, 200, 30, 255])
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    found = colours_at(painted(tmp_path / "a.obj", mesh), middles(mesh))
    np.testing.assert_array_equal(found, np.tile([10, 200, 30], (12, 1)))


def test_what_has_no_colour_is_grey():
    mesh = trimesh.creation.box((0.1, 0.1, 0.1))
    found = colours_at(unpainted(mesh), middles(mesh))
    assert found.dtype == np.uint8 and (found == GREY).all()


def test_colours_far_from_the_origin_are_those_near_it(tmp_path):
    """Single precision would lose the shape there."""
    near = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    near.visual = trimesh.visual.ColorVisuals(
        near, vertex_colors=np.random.default_rng(0).integers(0, 255, (len(near.vertices), 3))
    )
    far = near.copy()
    far.apply_translation([5000.0, -3000.0, 100.0])
    one = colours_at(painted(tmp_path / "a.glb", near), middles(near))
    # Binary glTF would round them: the mesh is taken as it is.
    two = colours_at(_as_painted(far), middles(far))
    assert np.abs(one.astype(int) - two).max() <= 2


def _as_painted(mesh):
    from brrp_cli.prior.build.coloured_mesh import Paint, PaintedMesh

    corners = np.asarray(mesh.visual.vertex_colors, np.float32)[:, :3][mesh.faces]
    return PaintedMesh(((trimesh.Trimesh(mesh.vertices, mesh.faces, process=False),
                         Paint(corners=corners)),))  # fmt: skip


def test_colours_come_through_the_transform_between_file_and_mesh():
    """The painted box is moved, turned and twice as large as the mesh that is kept."""
    mesh = trimesh.creation.box((1.0, 1.0, 1.0))
    turn = trimesh.transformations.rotation_matrix(0.5, [1, 2, 3])[:3, :3]
    T_mesh_painted = np.linalg.inv(similarity(2.0, turn, np.array([4.0, 5.0, 6.0])))
    in_file = mesh.copy()
    in_file.apply_transform(np.linalg.inv(T_mesh_painted))
    # One colour for each face of the box.
    sides = (np.abs(mesh.face_normals).argmax(axis=1) * 2 + (mesh.face_normals.sum(1) > 0)) * 40
    in_file.visual = trimesh.visual.ColorVisuals(
        in_file, face_colors=np.column_stack([sides] * 3).astype(np.uint8)
    )
    from brrp_cli.prior.build.coloured_mesh import Paint, PaintedMesh

    corners = np.repeat(in_file.visual.face_colors[:, None, :3].astype(np.float32), 3, axis=1)
    bare = trimesh.Trimesh(in_file.vertices, in_file.faces, process=False)
    painted_mesh = PaintedMesh(((bare, Paint(corners=corners)),))
    shape = stored_shape(
        mesh, painted_mesh, T_mesh_painted, FieldConfig(nodes=500), MeshConfig(edge=0.5)
    )
    # In the middle of a side there is no doubt.
    middle = np.sort(np.abs(shape.vertices), axis=1)[:, 1] < 0.3
    found = shape.colours[middle][:, 0]
    vertices = shape.vertices[middle]
    axis = np.abs(vertices).argmax(axis=1)
    positive = vertices[np.arange(len(vertices)), axis] > 0
    np.testing.assert_array_equal(found, (axis * 2 + positive) * 40)
    assert len(found) >= 6
    back = transform_points(np.linalg.inv(T_mesh_painted), shape.vertices.astype(np.float64))
    np.testing.assert_allclose([back.min(0), back.max(0)], in_file.bounds, atol=1e-5)
