from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from mesh_zoo import (
    ball_with_small_hole,
    bowl_sheet,
    box,
    moved_box,
    mug,
    thin_bowl,
    triangles,
    winding_number,
)

from brrp_cli.errors import MeshError
from brrp_cli.prior.build.repair import boundary_rims, repair
from brrp_cli.prior.build.solids import is_solid, unite_bodies

VOLUME = 0.10 * 0.06 * 0.04


def without_a_face() -> trimesh.Trimesh:
    mesh = box()
    mesh.update_faces(np.arange(12) != 3)
    return mesh


def inverted() -> trimesh.Trimesh:
    mesh = box()
    mesh.invert()
    return mesh


def mixed_winding() -> trimesh.Trimesh:
    faces = box().faces.copy()
    faces[::2] = faces[::2, ::-1]
    return triangles(box().vertices, faces)


def with_flap() -> trimesh.Trimesh:
    """An edge with four faces, as scanned meshes have: a fin of two faces back to back."""
    mesh = box()
    a, b = mesh.faces[0, :2]
    tip = len(mesh.vertices)
    fin = [[a, b, tip], [b, a, tip]]
    vertices = np.vstack([mesh.vertices, mesh.vertices[a] * 1.2])
    return triangles(vertices, np.vstack([mesh.faces, fin]))


def touching_along_an_edge() -> trimesh.Trimesh:
    mesh = trimesh.util.concatenate([box(), moved_box(0.10, 0.06, 0)])
    mesh.merge_vertices()
    return mesh


def one_of_two_inverted() -> trimesh.Trimesh:
    return trimesh.util.concatenate([inverted(), moved_box(0.3, 0, 0)])


def overlapping() -> trimesh.Trimesh:
    return trimesh.util.concatenate([box(), moved_box(0.05, 0, 0)])


def with_cavity() -> trimesh.Trimesh:
    cavity = inverted()
    cavity.apply_scale(0.5)
    return trimesh.util.concatenate([box(), cavity])


def duplicate_faces() -> trimesh.Trimesh:
    return triangles(box().vertices, np.vstack([box().faces, box().faces[:4]]))


@pytest.mark.parametrize(
    ("make", "volume", "closed_before", "told"),
    [
        (box, VOLUME, True, None),
        (with_cavity, VOLUME * 7 / 8, True, None),
        (without_a_face, VOLUME, False, "filled holes"),
        (inverted, VOLUME, False, "outward"),
        (mixed_winding, VOLUME, False, "winding"),
        (with_flap, VOLUME, False, "duplicate"),
        (duplicate_faces, VOLUME, False, "duplicate"),
        (touching_along_an_edge, 2 * VOLUME, False, "more than two faces"),
        (one_of_two_inverted, 2 * VOLUME, None, "turned 1"),
        (overlapping, 1.5 * VOLUME, True, "united 2"),
    ],
)
def test_repair_gives_the_known_solid(
    make: Callable[[], trimesh.Trimesh], volume: float, closed_before: bool | None, told: str | None
) -> None:
    original = make()
    repaired = repair(original)
    assert is_solid(repaired.mesh)
    assert repaired.mesh.volume == pytest.approx(volume, rel=1e-6)
    if closed_before is not None:
        assert repaired.record["closed_before"] is closed_before
    steps = "; ".join(repaired.record["steps"])
    assert (told in steps) if told else steps == ""


def test_a_small_hole_is_filled_and_told() -> None:
    repaired = repair(ball_with_small_hole())
    full = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    assert repaired.mesh.volume == pytest.approx(full.volume, rel=0.01)
    assert "small holes" in repaired.record["steps"][-1]
    assert repaired.record["original_to_repaired"]["max"] < 1e-6
    # The hole is 6 mm in radius: nothing of the patch is further from the ball's surface.
    assert 1e-4 < repaired.record["repaired_to_original"]["max"] < 0.007


@pytest.mark.parametrize("sides", [1, 2])
def test_the_opening_of_a_bowl_stays_open(sides: int) -> None:
    sheet = bowl_sheet()
    if sides == 2:
        sheet = triangles(sheet.vertices, np.vstack([sheet.faces, sheet.faces[:, ::-1]]))
    repaired = repair(sheet)
    assert is_solid(repaired.mesh)
    assert "sheets are walls of 1.2 mm" in repaired.record["steps"][-1]
    # Half a ball would be 1072 cm3; the wall is 40,200 mm2 x 1.2 mm.
    assert repaired.mesh.volume == pytest.approx(2 * np.pi * 0.08**2 * 0.0012, rel=0.1)
    hollow = np.array([[0, 0, -0.01], [0, 0, -0.04], [0.04, 0, -0.03]])
    assert np.abs(winding_number(repaired.mesh, hollow)).max() < 1e-6
    assert repaired.record["original_to_repaired"]["max"] < 0.002


@pytest.mark.parametrize("make", [thin_bowl, mug])
def test_closed_thin_shapes_are_not_moved(make: Callable[[], trimesh.Trimesh]) -> None:
    repaired = repair(make())
    assert is_solid(repaired.mesh)
    assert repaired.record["repaired_to_original"]["max"] < 1e-6


def test_the_original_is_not_changed() -> None:
    original = without_a_face()
    before = original.faces.copy()
    repair(original)
    np.testing.assert_array_equal(original.faces, before)


def test_rims_are_told_apart() -> None:
    tube = trimesh.creation.cylinder(radius=0.03, height=0.1, sections=24)
    tube.update_faces(np.abs(tube.face_normals[:, 2]) < 0.5)
    rims = boundary_rims(tube)
    assert sorted(len(rim) for rim in rims) == [24, 24]
    assert sorted(float(rim[:, 2].mean()) for rim in rims) == pytest.approx([-0.05, 0.05])


def test_what_encloses_nothing_is_refused() -> None:
    needles = triangles(np.eye(4, 3) * 0.1, np.array([[0, 1, 1], [0, 2, 2]]))
    in_a_line = triangles(np.eye(1, 3) * [[0.0], [0.1], [0.2]], np.array([[0, 1, 2]]))
    for mesh in (needles, in_a_line):
        with pytest.raises(MeshError, match="encloses nothing"):
            repair(mesh)


def test_edges_that_no_split_parts_do_not_stop_the_filling_of_holes() -> None:
    """Faces across the inside of a box share edges with its walls; of these, a split of their
    vertices leaves one with more than two faces. The hole to fill is in a ball beside the box."""
    across = [[6, 3, 5], [3, 2, 4], [2, 0, 4]]
    crossed = triangles(box().vertices, np.vstack([box().faces, across]))
    ball = ball_with_small_hole()
    ball.apply_translation((0.5, 0, 0))
    repaired = repair(trimesh.util.concatenate([crossed, ball]))
    assert is_solid(repaired.mesh)
    assert any("no split parts" in step for step in repaired.record["steps"])
    assert repaired.record["original_to_repaired"]["max"] < 0.03


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_sheet_beside_a_box_is_dropped_without_a_warning() -> None:
    corners = [[0.2, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.1, 0.0]]
    sheet = trimesh.Trimesh(corners, [[0, 1, 2], [2, 1, 0]], process=False)
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    united, steps = unite_bodies(trimesh.util.concatenate([box, sheet]))
    assert united.volume == pytest.approx(box.volume)
    assert steps == ["dropped 1 bodies without volume"]
