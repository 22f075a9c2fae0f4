"""Meshes of objects that no stored one explains: closed, of the right volume, on the table."""

import numpy as np
import pytest
import trimesh
from table_scene import (
    T_WORLD_CAM,
    TABLE,
    box,
    completed_grid,
    in_camera,
    photograph,
    placed,
    surface_seen,
)

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.completion.visible_part import visible_part
from brrp_cli.config import preset
from brrp_cli.inference.mean_grid import grid_over
from brrp_cli.shapes import kinds, solids
from brrp_cli.surface.extract import level_set

CONFIG = preset("default")


def completed_mesh(meshes, object_id=5):
    """The completion alone, at a probability of a half, of one of the things on the table."""
    hypotheses = CONFIG.hypotheses
    frame = photograph(meshes)
    seen = frame.object_points(object_id)
    part = visible_part(seen, frame, object_id, TABLE, hypotheses.completion)
    margin = hypotheses.map.margin
    around = np.stack([part.extent.min(axis=0) - margin, part.extent.max(axis=0) + margin])
    lower, spacing, nodes = grid_over(around, 60_000)
    empty = empty_space(nodes.reshape(-1, 3), frame, object_id, TABLE, hypotheses.mean)
    surface = surface_seen(frame, object_id)
    logits = completed_grid(nodes, empty.reshape(nodes.shape[:3]), part, surface, hypotheses.mean)
    occupancy = 1 / (1 + np.exp(-logits.astype(np.float64)))
    axes = tuple(lower[i] + spacing * np.arange(nodes.shape[i]) for i in range(3))
    found = level_set(occupancy, axes, seen, 0.5, CONFIG.surface)
    return trimesh.Trimesh(found.vertices, found.faces)


SOLIDS = {
    "box": box(),
    "can": solids.cylinder(0.04, 0.12),
    "ball": solids.ball(0.04),
    "flat box": solids.box(0.14, 0.09, 0.03),
    "tall box": solids.box(0.06, 0.05, 0.2),
}
HOLLOW = {
    "bowl": solids.spherical_bowl(0.035, 0.080, 0.055, 0.005),
    "cup": solids.beaker(0.035, 0.042, 0.08, 0.004),
    "mug": kinds.mug(0.042, 0.095, 0.005, 0.035),
    "plate": kinds.plate(0.1, 0.025, 0.006, 0.06),
}


@pytest.mark.parametrize("name", [*SOLIDS, *HOLLOW])
def test_it_is_one_closed_piece_that_stands_on_the_table(name):
    T = placed(0.0, 0.0, 0.6)
    mesh = completed_mesh({5: in_camera({**SOLIDS, **HOLLOW}[name], T)})
    assert mesh.is_volume
    assert mesh.body_count == 1
    assert abs(TABLE.signed_distance(mesh.vertices).min()) < 0.005


@pytest.mark.parametrize("name", list(SOLIDS))
@pytest.mark.parametrize("yaw", [0.1, 0.8])
def test_solids_have_about_their_volume(name, yaw):
    mesh = completed_mesh({5: in_camera(SOLIDS[name], placed(0.02, -0.03, yaw))})
    assert 0.75 < mesh.volume / SOLIDS[name].volume < 1.3


@pytest.mark.parametrize("name", list(HOLLOW))
def test_what_is_looked_into_is_hollow_with_walls(name):
    """Less than half of what it would be if it were full, and not much less than it is."""
    true = HOLLOW[name]
    mesh = completed_mesh({5: in_camera(true, placed(0.0, 0.0, 0.3))})
    assert mesh.volume > 0.6 * true.volume
    assert mesh.volume < 0.6 * true.convex_hull.volume


def test_what_stands_behind_something_reaches_down_to_the_table():
    """Its lower half is hidden: neither does it float, nor does it grow into what hides it."""
    x, y = 0.09 * T_WORLD_CAM[:2, 3] / np.linalg.norm(T_WORLD_CAM[:2, 3])
    before = placed(x, y, np.arctan2(y, x) - np.pi / 2)
    low = solids.box(0.16, 0.03, 0.06)
    behind = in_camera(box(), placed(0.0, 0.0, 0.6))
    mesh = completed_mesh({5: behind, 6: in_camera(low, before)})
    assert mesh.body_count == 1
    assert abs(TABLE.signed_distance(mesh.vertices).min()) < 0.012
    assert 0.7 < mesh.volume / box().volume < 1.3
