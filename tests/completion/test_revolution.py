"""A cup that a camera sees from one side: what the turn about its axis says of the rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import trimesh

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.completion.revolution import round_logits
from brrp_cli.completion.revolution_axis import Axis
from brrp_cli.completion.roundness import axis_of
from brrp_cli.completion.visible_part import VisiblePart, visible_part
from brrp_cli.config import CompletionConfig, MeanConfig, RevolutionConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, transform_points
from brrp_cli.inference.mean_grid import grid_over
from brrp_cli.observation.support_plane import Plane
from brrp_cli.raycast import look

MEAN = MeanConfig()
K = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
CUP = 1
OUTER, INNER, HEIGHT, FLOOR = 0.04, 0.034, 0.09, 0.006
SHELL = 0.004


@dataclass(frozen=True)
class Seen:
    """What a camera 0.7 m away sees of things on a table, and where the world is: z up, the table
    at z = 0, the cup's axis the z axis, the camera over -y."""

    frame: Frame
    plane: Plane
    part: VisiblePart
    T_cam_world: np.ndarray

    @property
    def axis(self) -> Axis:
        """As found."""
        up = self.plane.normal
        found = axis_of(self.part.seen, self.part.normals, up, RevolutionConfig())
        assert found is not None
        return found


def cup():
    outline = [(0, 0), (OUTER, 0), (OUTER, HEIGHT), (INNER, HEIGHT), (INNER, FLOOR), (0, FLOOR)]
    return trimesh.creation.revolve(np.array(outline), sections=128)


def seen(*meshes):
    """`meshes` make one object."""
    eye = np.array([0.0, -0.5, 0.5])
    forward = -eye / np.linalg.norm(eye)
    right = np.array([1.0, 0, 0])
    T_world_cam = np.eye(4)
    T_world_cam[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    T_world_cam[:3, 3] = eye
    T_cam_world = np.linalg.inv(T_world_cam)
    table = trimesh.creation.box(
        (2, 2, 0.02), transform=trimesh.transformations.translation_matrix([0, 0, -0.01])
    )
    posed = [mesh.copy().apply_transform(T_cam_world) for mesh in (table, *meshes)]
    sight = look(posed, K, (480, 640))
    depth = np.where(sight.depth > 0, sight.depth, np.nan).astype(np.float64)
    segmap = np.where(sight.index > 0, CUP, 0)
    frame = Frame(np.zeros((480, 640, 3), np.uint8), backproject(depth, K), segmap, K)
    normal = T_cam_world[:3, 2]
    plane = Plane(normal, float(-normal @ T_cam_world[:3, 3]))
    part = visible_part(frame.object_points(CUP), frame, CUP, plane, CompletionConfig())
    return Seen(frame, plane, part, T_cam_world)


@pytest.fixture(scope="module")
def plain():
    return seen(cup())


def logits_at(view, world, guess=-4.0):
    """Logits (n,) at points (n, 3) of the world, where the network thinks `guess` everywhere; the
    nearest node's."""
    box = np.array([[-0.09, -0.09, -0.01], [0.09, 0.09, 0.11]])
    corners = transform_points(view.T_cam_world, trimesh.bounds.corners(box))
    lower, spacing, nodes = grid_over(np.stack([corners.min(axis=0), corners.max(axis=0)]), 200_000)
    empty = empty_space(nodes.reshape(-1, 3), view.frame, CUP, view.plane, MEAN)
    empty = empty.reshape(nodes.shape[:3])
    thinks = np.full(empty.shape, guess, np.float32)
    found = round_logits(view.axis, nodes, empty, thinks, view.part, SHELL, MEAN)
    found = np.where(empty, -MEAN.limit, found)
    index = np.rint((transform_points(view.T_cam_world, world) - lower) / spacing).astype(int)
    return found[tuple(index.T)]


def ring(radius, height, turns=24):
    angle = np.arange(turns) * 2 * np.pi / turns
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(turns, height)], 1)


def test_the_axis_is_the_cups(plain):
    axis = plain.axis
    assert abs(axis.direction @ plain.plane.normal) > 0.9999
    middle = transform_points(plain.T_cam_world, np.array([[0.0, 0.0, HEIGHT / 2]]))
    assert axis.radii(middle)[0][0] < 0.001


@pytest.mark.parametrize("height", [0.05, 0.07])
def test_the_wall_goes_all_around_though_the_network_knows_of_none(plain, height):
    wall = logits_at(plain, ring((OUTER + INNER) / 2, height))
    assert (wall > 0).all()


def test_beside_the_wall_it_is_free_all_around(plain):
    """The outer side of the back and the inner side of the front were not seen."""
    for radius in (OUTER + 0.006, INNER - 0.006, 0.01):
        assert (logits_at(plain, ring(radius, 0.06), guess=4.0) < 0).all()


def test_what_was_seen_from_nowhere_is_the_networks(plain):
    under = ring(0.02, 0.003)
    assert (logits_at(plain, under, guess=1.5) > 0).all()
    assert (logits_at(plain, under, guess=-1.5) < 0).all()


def test_a_handle_stays_and_is_not_turned():
    handle = trimesh.creation.box((0.03, 0.008, 0.05))
    handle.apply_translation([OUTER + 0.013, 0, 0.045])
    view = seen(cup(), handle)
    in_it = np.array([[OUTER + 0.015, 0.0, 0.045], [OUTER + 0.02, 0.0, 0.05]])
    assert (logits_at(view, in_it, guess=2.0) > 0).all()
    mirrored = in_it * [-1, 1, 1]
    behind = in_it[:, [1, 0, 2]]
    for elsewhere in (mirrored, behind):
        assert (logits_at(view, elsewhere, guess=2.0) < 0).all()


def test_turned_depth_does_not_depend_on_a_ring_that_a_hole_leaves_open(plain):
    """Without depth on one side of the wall, the other side tells where it is."""
    frame = plain.frame
    points = frame.points.copy()
    left = (frame.segmap == CUP) & (np.arange(640) < 320)[None]
    points[left & (np.arange(480) % 2 == 0)[:, None]] = np.nan
    holed = frame.with_points(points)
    part = visible_part(holed.object_points(CUP), holed, CUP, plain.plane, CompletionConfig())
    view = replace(plain, frame=holed, part=part)
    assert (logits_at(view, ring((OUTER + INNER) / 2, 0.06)) > 0).all()
