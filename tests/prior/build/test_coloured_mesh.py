import numpy as np
import pytest
import trimesh
from PIL import Image

from brrp_cli.errors import MeshError
from brrp_cli.prior.build.coloured_mesh import load_painted, unpainted
from brrp_cli.prior.build.views import directions, views_around

RED, GREEN = (200, 30, 20), (20, 180, 60)


def box():
    return trimesh.creation.box((0.1, 0.06, 0.04))


def seen_colours(path, **options):
    sides = views_around(load_painted(path, **options), 12, 300)
    return np.concatenate([side.rgb for side in sides])


def test_vertex_colours(tmp_path):
    mesh = box()
    mesh.visual.vertex_colors = np.where(mesh.vertices[:, :1] > 0, [RED], [GREEN])
    mesh.export(tmp_path / "box.ply")
    for side in views_around(load_painted(tmp_path / "box.ply"), 12, 300):
        at_end = np.abs(side.points[:, 0]) > 0.0499
        expected = np.where(side.points[at_end, :1] > 0, [RED], [GREEN])
        np.testing.assert_allclose(side.rgb[at_end], expected, atol=2)


def test_a_texture_is_the_right_way_up(tmp_path):
    mesh = box()
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32], pixels[32:] = RED, GREEN
    # v runs upward: the image's upper half is v > 1/2.
    uv = np.column_stack([np.full(8, 0.5), np.where(mesh.vertices[:, 2] > 0, 0.9, 0.1)])
    material = trimesh.visual.material.SimpleMaterial(image=Image.fromarray(pixels))
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    (tmp_path / "box").mkdir()
    mesh.export(tmp_path / "box" / "box.obj")
    for side in views_around(load_painted(tmp_path / "box" / "box.obj"), 12, 300):
        high = side.points[:, 2] > 0.012
        low = side.points[:, 2] < -0.012
        assert np.allclose(side.rgb[high], RED, atol=3) and np.allclose(
            side.rgb[low], GREEN, atol=3
        )


def test_faces_on_both_sides_of_a_seam_keep_their_colours(tmp_path):
    """A vertex on a seam has other coordinates in the texture for each of its faces."""
    mesh = box()
    side = np.repeat(np.arange(6), 2)[np.argsort(np.argsort(mesh.face_normals @ [1, 2, 4]))]
    colours = np.array([RED, GREEN, (30, 60, 200), (220, 200, 40), (240, 240, 240), (90, 20, 120)])
    # Six squares of colour in black, one for each side of the box.
    pixels = np.zeros((64, 6 * 64, 3), np.uint8)
    for number, colour in enumerate(colours):
        pixels[16:48, number * 64 + 16 : number * 64 + 48] = colour
    Image.fromarray(pixels).save(tmp_path / "box.png")
    (tmp_path / "box.mtl").write_text("newmtl paint\nmap_Kd box.png\n")
    lines = ["mtllib box.mtl", "usemtl paint"]
    lines += ["v {} {} {}".format(*v) for v in mesh.vertices]
    square = np.array([[0.3, 0.3], [0.7, 0.3], [0.5, 0.7]])
    for number in range(6):
        lines += [f"vt {(number + u) / 6} {v}" for u, v in square]
    for face, number in zip(mesh.faces, side, strict=True):
        corners = [f"{v + 1}/{3 * number + i + 1}" for i, v in enumerate(face)]
        lines.append("f " + " ".join(corners))
    (tmp_path / "box.obj").write_text("\n".join(lines) + "\n")
    for seen in views_around(load_painted(tmp_path / "box.obj"), 12, 300):
        which = np.argmax(seen.normals @ mesh.face_normals.T, axis=1)
        np.testing.assert_allclose(seen.rgb, colours[side[which]], atol=2)


def test_a_plain_material(tmp_path):
    (tmp_path / "box.mtl").write_text("newmtl paint\nKd 0.8 0.1 0.1\n")
    lines = ["mtllib box.mtl", "usemtl paint"]
    mesh = box()
    lines += ["v {} {} {}".format(*v) for v in mesh.vertices]
    lines += ["f {} {} {}".format(*(f + 1)) for f in mesh.faces]
    (tmp_path / "box.obj").write_text("\n".join(lines) + "\n")
    rgb = seen_colours(tmp_path / "box.obj")
    np.testing.assert_allclose(rgb, np.tile([204, 26, 26], (len(rgb), 1)), atol=1)


def test_a_mesh_without_colours_has_none(tmp_path):
    box().export(tmp_path / "box.stl")
    assert np.isnan(seen_colours(tmp_path / "box.stl")).all()


def test_a_damaged_texture_is_a_mesh_error(tmp_path):
    (tmp_path / "box.glb").write_bytes(b"glTF no more")
    with pytest.raises(MeshError, match="colours"):
        load_painted(tmp_path / "box.glb")


def test_directions_are_spread_evenly():
    ways = directions(32)
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1)
    nearest = np.sort(ways @ ways.T, axis=1)[:, -2]
    assert np.degrees(np.arccos(nearest)).min() > 20
    assert np.linalg.norm(ways.mean(axis=0)) < 0.02


def test_what_is_seen_lies_on_the_surface_and_faces_the_viewer():
    mesh = box()
    for toward, side in zip(directions(12), views_around(unpainted(mesh), 12, 400), strict=True):
        assert len(side.points) > 50
        distance = np.abs(np.abs(side.points) - mesh.extents / 2).min(axis=1)
        assert distance.max() < 1e-5
        assert (side.normals @ toward > 0).all()


def test_far_from_the_origin_nothing_changes():
    near, far = box(), box()
    far.apply_translation([40.0, -90.0, 3.0])
    for one, two in zip(
        views_around(unpainted(near), 6, 3000), views_around(unpainted(far), 6, 3000), strict=True
    ):
        np.testing.assert_allclose(one.points, two.points, atol=1e-4)
