"""A cup that a camera sees from one side: what the turn about its axis says of the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from table_scene import T_CAM_WORLD, TABLE, in_camera, photograph
from trimesh.bounds import corners

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.completion.revolution import round_logits
from brrp_cli.completion.revolution_axis import Axis
from brrp_cli.completion.roundness import axis_of
from brrp_cli.completion.visible_part import VisiblePart, visible_part
from brrp_cli.config import CompletionConfig, MeanConfig, RevolutionConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points
from brrp_cli.inference.mean_grid import grid_over
from brrp_cli.shapes import solids

MEAN = MeanConfig()
CUP = 1
BASE, RIM, HEIGHT, WALL = 0.045, 0.055, 0.11, 0.007
SHELL = 0.004


@dataclass(frozen=True)
class Seen:
    """What the camera sees of things at the world's origin, z up, on the table at z = 0."""

    frame: Frame
    part: VisiblePart

    @property
    def axis(self) -> Axis:
        """As found."""
        found = axis_of(self.part.seen, self.part.normals, TABLE.normal, RevolutionConfig())
        assert found is not None
        return found


def cup():
    return solids.beaker(BASE, RIM, HEIGHT, WALL)


def shown(frame):
    part = visible_part(frame.object_points(CUP), frame, CUP, TABLE, CompletionConfig())
    return Seen(frame, part)


def seen(mesh):
    return shown(photograph({CUP: in_camera(mesh, T_CAM_WORLD)}))


@pytest.fixture(scope="module")
def plain():
    return seen(cup())


def logits_at(view, world, guess=-4.0):
    """Logits (n,) at points (n, 3) of the world, where the network thinks `guess` everywhere; the
    nearest node's."""
    box = transform_points(
        T_CAM_WORLD, corners(np.array([[-0.11, -0.11, -0.01], [0.11, 0.11, 0.13]]))
    )
    lower, spacing, nodes = grid_over(np.stack([box.min(axis=0), box.max(axis=0)]), 400_000)
    empty = empty_space(nodes.reshape(-1, 3), view.frame, CUP, TABLE, MEAN)
    empty = empty.reshape(nodes.shape[:3])
    thinks = np.full(empty.shape, guess, np.float32)
    found = round_logits(view.axis, nodes, empty, thinks, view.part, SHELL, MEAN)
    found = np.where(empty, -MEAN.limit, found)
    index = np.rint((transform_points(T_CAM_WORLD, world) - lower) / spacing).astype(int)
    return found[tuple(index.T)]


def ring(height, beside=0.0, turns=24):
    """Points at a height of the wall's middle, and so much beside it."""
    radius = BASE + (RIM - BASE) * height / HEIGHT - WALL / 2 + beside
    angle = np.arange(turns) * 2 * np.pi / turns
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.column_stack([radius * around, np.full(turns, height)])


def test_the_axis_is_the_cups(plain):
    axis = plain.axis
    assert abs(axis.direction @ TABLE.normal) > 0.9999
    middle = transform_points(T_CAM_WORLD, np.array([[0.0, 0.0, HEIGHT / 2]]))
    assert axis.radii(middle)[0][0] < 0.001


@pytest.mark.parametrize("height", [0.07, 0.09])
def test_the_wall_goes_all_around_though_the_network_knows_of_none(plain, height):
    assert (logits_at(plain, ring(height)) > 0).all()


def test_beside_the_wall_it_is_free_all_around(plain):
    """The outer side of the back and the inner side of the front were not seen."""
    for beside in (WALL / 2 + 0.006, -WALL / 2 - 0.006, -0.03):
        assert (logits_at(plain, ring(0.08, beside), guess=4.0) < 0).all()


def test_what_was_seen_from_nowhere_is_the_networks(plain):
    under = ring(0.003, -0.02)
    assert (logits_at(plain, under, guess=1.5) > 0).all()
    assert (logits_at(plain, under, guess=-1.5) < 0).all()


def test_a_handle_stays_and_is_not_turned():
    handle = solids.moved(solids.box(0.04, 0.01, 0.06), x=RIM + 0.014, z=0.03)
    view = seen(solids.union(cup(), handle))
    within = np.array([[RIM + 0.018, 0.0, 0.06], [RIM + 0.022, 0.0, 0.065]])
    assert (logits_at(view, within, guess=2.0) > 0).all()
    for elsewhere in (within * [-1, 1, 1], within[:, [1, 0, 2]]):
        assert (logits_at(view, elsewhere, guess=2.0) < 0).all()


def test_holes_in_the_depth_are_filled_from_other_sides(plain):
    points = plain.frame.points.copy()
    rows, columns = np.indices(plain.frame.shape)
    lost = (plain.frame.segmap == CUP) & (columns < plain.frame.shape[1] / 2) & (rows % 2 == 0)
    points[lost] = np.nan
    holed = shown(plain.frame.with_points(points))
    assert (logits_at(holed, ring(0.08)) > 0).all()
