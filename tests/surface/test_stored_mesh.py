"""The stored mesh moved to a posterior's level set, against corrections of known size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from closed_shapes import CUP_WALL, at, cup

from brrp_cli.config import SurfaceConfig
from brrp_cli.geometry import similarity
from brrp_cli.inference.hinge import HingeGrid
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.reconstruction import METRES
from brrp_cli.surface.extract import extract_surface
from brrp_cli.surface.stored_mesh import along_normals, moved_to_level, wall_thickness

CONFIG = SurfaceConfig()
CENTER = np.array([0.1, -0.05, 0.8])
TURN = trimesh.transformations.rotation_matrix(0.8, [1, 2, 3])[:3, :3]
T = similarity(1.0, TURN, CENTER)
WIDTH = 0.001


@pytest.fixture(scope="module")
def block():
    return at(trimesh.creation.box((0.06, 0.05, 0.04)), T, name="block", width=WIDTH)


@pytest.fixture(scope="module")
def thin():
    return at(cup(), T, name="cup", width=WIDTH)


def corrected(means, logit=0.0, shares=None):
    """One particle a hypothesis, each with a correction that is everywhere the same: the bias."""
    shares = np.full(len(means), 1 / len(means)) if shares is None else np.array(shares)
    grid = HingeGrid((0.0, 0.0, 0.0), (1, 1, 1), 1.0, 1e-7)
    weights = np.zeros((len(means), grid.dimension), np.float32)
    weights[:, 0] = logit
    correction = HilbertPosterior(weights, CENTER, grid, 0.1)
    box = np.stack([CENTER - 0.08, CENTER + 0.08])
    return HypothesisPosterior(tuple(means), np.arange(len(means)), shares, correction, box)


def moved_mesh(posterior, config=CONFIG):
    """The first hypothesis's mesh at the level set of all of them."""
    return moved_to_level(along_normals(posterior, 0, config), config.level)


def offsets(moved, shape):
    """How far each vertex went outwards, metres; it goes nowhere else."""
    way = moved.vertices - shape.vertices
    offset = np.einsum("ij,ij->i", way, shape.normals)
    np.testing.assert_allclose(way, offset[:, None] * shape.normals, atol=1e-9)
    return offset


def test_without_a_correction_it_is_the_placed_mesh(block, thin):
    for shape in (block, thin):
        moved = moved_mesh(corrected([shape]))
        np.testing.assert_allclose(moved.vertices, shape.vertices, atol=1e-8)
        assert moved.off == 0
        # The spread of a logistic surface: pi s / sqrt(3).
        spread = np.pi * WIDTH / np.sqrt(3)
        assert np.median(moved.deviation) == pytest.approx(spread, rel=0.03)


@pytest.mark.parametrize("logit", [-2.5, -1.0, 0.5, 2.0])
def test_a_constant_correction_moves_it_by_its_width_times_the_logit(block, logit):
    moved = moved_mesh(corrected([block], logit))
    np.testing.assert_allclose(offsets(moved, block), WIDTH * logit, atol=2e-5)
    assert moved.off == 0


def test_a_softer_shape_is_moved_further(block):
    soft = replace(block, width=2 * WIDTH)
    moved = moved_mesh(corrected([soft], 1.0))
    np.testing.assert_allclose(offsets(moved, soft), 2 * WIDTH, atol=2e-5)


def test_another_level_lies_further_out_or_in(block):
    for level in (0.2, 0.8):
        moved = moved_mesh(corrected([block]), replace(CONFIG, level=level))
        expected = -WIDTH * np.log(level / (1 - level))
        # Between two of the places that are looked at, occupancy is taken for a straight line.
        np.testing.assert_allclose(offsets(moved, block), expected, atol=5e-5)


def test_what_the_level_set_lies_out_of_reach_of_is_counted(block):
    """A correction of 4.9 would move it by 4.9 mm, 4 mm is the most."""
    for sign in (1, -1):
        moved = moved_mesh(corrected([block], sign * 4.9))
        assert moved.off == 1
        np.testing.assert_allclose(offsets(moved, block), sign * CONFIG.farthest, atol=1e-9)
        assert (moved.deviation > 0.01).all(), "where it is not known, it is not sure"


def test_thickness_is_the_way_through_the_wall(block, thin):
    mesh = trimesh.creation.box((0.06, 0.05, 0.04))
    local = (block.vertices - CENTER) @ TURN
    thickness = wall_thickness(block)
    for axis, side in enumerate(mesh.extents):
        flat = np.abs(local) > mesh.extents / 2 - 1e-6
        face = flat[:, axis] & (flat.sum(axis=1) == 1)
        assert face.any()
        np.testing.assert_allclose(thickness[face], side, atol=1e-5)
    local = (thin.vertices - CENTER) @ TURN
    between = (local[:, 2] > 0.01) & (local[:, 2] < 0.07)
    assert between.sum() > 100
    np.testing.assert_allclose(wall_thickness(thin)[between], CUP_WALL, rtol=0.05)


@pytest.mark.parametrize("logit", [-4.0, -0.7, 0.5, 4.0])
def test_the_two_sides_of_a_wall_never_meet(thin, logit):
    """0.7 of 1.5 mm from either side would be 1.4 mm: neither may go by more than its share."""
    moved = moved_mesh(corrected([thin], logit))
    offset = offsets(moved, thin)
    thickness = wall_thickness(thin)
    assert (offset >= -CONFIG.wall_share * thickness - 1e-9).all()
    mesh = trimesh.Trimesh(moved.vertices, thin.shape.faces, process=False)
    assert mesh.is_watertight and mesh.volume > 0
    original = trimesh.Trimesh(thin.vertices, thin.shape.faces, process=False)
    # A fifth of the wall is left at least, and between foot and rim no face is turned over.
    assert mesh.volume > 0.18 * original.volume
    height = ((original.triangles_center - CENTER) @ TURN)[:, 2]
    between = (height > 0.01) & (height < 0.07)
    assert between.sum() > 1000
    assert (np.einsum("ij,ij->i", mesh.face_normals, original.face_normals)[between] > 0).all()


def test_placements_are_averaged_as_probabilities(block):
    """Two placements of the same shape, 2 mm apart along its x axis: the surface lies between."""
    step = TURN @ np.array([0.002, 0, 0])
    other = replace(block, T_cam_shape=similarity(translation=step) @ block.T_cam_shape)
    moved = moved_mesh(corrected([block, other]))
    local = (block.vertices - CENTER) @ TURN
    flat = np.abs(local) > np.array([0.03, 0.025, 0.02]) - 1e-6
    offset = offsets(moved, block)
    for sign in (1, -1):
        face = flat[:, 0] & (flat.sum(axis=1) == 1) & (sign * local[:, 0] > 0)
        np.testing.assert_allclose(offset[face], sign * 0.001, atol=5e-5)
        assert (moved.deviation[face] > moved.deviation[flat[:, 1] & ~flat[:, 0]].mean()).all()
    heavier = moved_mesh(corrected([block, other], shares=(0.9, 0.1)))
    assert np.abs(offsets(heavier, block)).max() < 0.0005


OBSERVED = CENTER[None]


def test_where_placements_part_the_surface_is_as_uncertain_as_they_are_apart(block):
    """Two of them, one 8 mm along the block's own x: between them occupancy hardly falls."""
    shift = np.eye(4)
    shift[:3, 3] = 0.008 * TURN[:, 0]
    other = replace(block, T_cam_shape=shift @ block.T_cam_shape)
    both = corrected([block, other], shares=(0.6, 0.4))
    alone = extract_surface(corrected([block]), block.vertices, CONFIG)
    found = extract_surface(both, block.vertices, CONFIG)
    local = (found.vertices - CENTER) @ TURN
    own = alone.uncertainty.mean()
    # The face that both placements have apart, and the faces that lie in one plane.
    parted = found.uncertainty[local[:, 0] < -0.0299]
    np.testing.assert_allclose(parted, np.hypot(own, np.sqrt(0.4) * 0.008), rtol=0.1)
    shared = found.uncertainty[np.abs(local[:, 0]) < 0.015]
    np.testing.assert_allclose(shared, own, rtol=0.1)


def test_a_wall_too_thin_for_the_way_is_as_uncertain_as_its_surface_is_beyond(thin):
    """A correction of -2 moves the surface inwards by 2 widths, further than half of the wall."""
    assert 0.4 * CUP_WALL < 2 * WIDTH
    through = along_normals(corrected([thin], -2.0), 0, CONFIG)
    on_wall = wall_thickness(thin) < 1.5 * CUP_WALL
    ends = through.way[0, on_wall]
    np.testing.assert_allclose(through.beyond[on_wall], 2 * WIDTH + ends, atol=1e-5)
    found = extract_surface(corrected([thin], -2.0), thin.vertices, replace(CONFIG, most_off=1.0))
    spread = np.hypot(np.pi * WIDTH / np.sqrt(3), through.beyond[on_wall])
    np.testing.assert_allclose(found.uncertainty[on_wall], spread, rtol=0.02)


def test_a_recognised_object_has_its_own_mesh_with_its_colours(block):
    surface = extract_surface(corrected([block], 0.5), OBSERVED, CONFIG)
    np.testing.assert_array_equal(surface.faces, block.shape.faces)
    np.testing.assert_array_equal(surface.colours, block.shape.colours)
    assert surface.uncertainty_unit == METRES
    assert surface.as_trimesh().is_watertight


def test_a_mesh_that_cannot_follow_gives_way_to_marching_cubes(block):
    """Twice as far out as it may be moved."""
    soft = replace(block, width=2 * WIDTH)
    surface = extract_surface(corrected([soft], 4.0), OBSERVED, CONFIG)
    assert surface.colours is None and len(surface.vertices) != len(block.vertices)
    mesh = surface.as_trimesh()
    assert mesh.is_watertight and mesh.volume > 0
    # All sides 8 mm further out, with rounded edges.
    local = (surface.vertices - CENTER) @ TURN
    np.testing.assert_allclose(
        np.abs(local).max(axis=0), np.array([0.03, 0.025, 0.02]) + 0.008, atol=0.001
    )


def test_what_no_shape_explains_comes_from_marching_cubes(block):
    """The placed shape weighs no more than a half: it does not dominate."""
    cube = at(trimesh.creation.box((0.05, 0.05, 0.05)), T, name="cube", width=WIDTH)
    surface = extract_surface(corrected([block, cube], shares=(0.5, 0.5)), OBSERVED, CONFIG)
    assert surface.colours is None and surface.as_trimesh().is_watertight


def test_a_correction_that_is_no_number_never_becomes_a_mesh(block):
    from brrp_cli.errors import BrrpError

    with pytest.raises(BrrpError, match="NaN or infinite"):
        extract_surface(corrected([block], np.nan), OBSERVED, CONFIG)
