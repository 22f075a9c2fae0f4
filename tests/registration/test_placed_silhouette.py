"""Silhouettes of placed models against masks whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from table_scene import K, box, in_camera, photograph, placed, stored
from trimesh import creation

from brrp_cli.config.seen_mask import SilhouetteConfig
from brrp_cli.distance_loops import nearest_along
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, similarity
from brrp_cli.prior.distance_field import distance_field
from brrp_cli.prior.parameters import FieldConfig
from brrp_cli.registration.model import search_model
from brrp_cli.registration.silhouette import bare_and_spilled, silhouette

BOX, CONFIG, TOLERANCE = 5, SilhouetteConfig(), 0.003
MIDDLE = similarity(translation=np.array([0, 0, 0.07]))
WHERE = placed(0.02, -0.03, 0.5)


@pytest.fixture(scope="module")
def model():
    return search_model(stored("box"))


@pytest.fixture(scope="module")
def frame():
    return photograph({BOX: in_camera(box(), WHERE)})


def compared(frame, model, T_cam_model):
    seen = silhouette(frame, BOX, CONFIG)
    bare, spilled = bare_and_spilled(T_cam_model[None], model, seen, TOLERANCE, CONFIG)
    return bare[0], spilled[0]


def without_depth(frame: Frame, pixels: np.ndarray) -> Frame:
    depth = np.where(pixels, np.nan, frame.depth)
    return replace(frame, points=backproject(depth.astype(np.float32), K))


def test_the_true_placement_fills_its_mask_and_no_more(frame, model):
    bare, spilled = compared(frame, model, WHERE @ MIDDLE)
    assert bare == 0 and spilled < 0.01


def test_a_mask_without_depth_says_the_same(frame, model):
    blind = without_depth(frame, frame.segmap == BOX)
    for T in (WHERE @ MIDDLE, placed(0.06, -0.03, 0.5) @ MIDDLE):
        np.testing.assert_allclose(compared(blind, model, T), compared(frame, model, T))


def test_shares_are_those_of_the_pixels(frame, model):
    """Half of the mask is cut off: the model covers as much beside it as it covers of it."""
    mask = frame.segmap == BOX
    columns = np.flatnonzero(mask.any(axis=0))
    right = np.zeros_like(mask)
    right[:, (columns[0] + columns[-1]) // 2 :] = True
    half = replace(frame, segmap=np.where(mask & ~right, BOX, 0))
    share = (mask & right).sum() / (mask & ~right).sum()
    bare, spilled = compared(half, model, WHERE @ MIDDLE)
    assert bare == 0 and spilled == pytest.approx(share, rel=0.15)


def test_what_stands_in_front_excuses(frame, model):
    """The model beside the mask, where another object or a nearer surface hides it."""
    beside = placed(0.10, -0.03, 0.5) @ MIDDLE
    bare, spilled = compared(frame, model, beside)
    assert bare > 0.3 and spilled > 0.3
    mask = frame.segmap == BOX
    nearer = np.where(mask, frame.depth, 0.2).astype(np.float32)
    behind = replace(frame, points=backproject(nearer, K))
    assert compared(behind, model, beside) == (bare, 0.0)
    # Pixels without depth are open where they are the background's, and may hide where not.
    blind = without_depth(frame, ~mask)
    assert compared(blind, model, beside) == pytest.approx((bare, spilled), abs=0.02)
    other = replace(blind, segmap=np.where(mask, BOX, 9))
    assert compared(other, model, beside) == (bare, 0.0)


def test_rays_pass_a_ball_as_far_as_they_do():
    """A ball of 5 cm, 50 cm ahead: rays at known distances from its middle."""
    field = distance_field(creation.icosphere(subdivisions=5), FieldConfig())
    off = np.array([0.0, 0.04, 0.052, 0.1])
    rays = np.stack([off / 0.5, np.zeros(4), np.ones(4)], axis=1)
    T = similarity(translation=np.array([0, 0, -0.5]))
    least, at = nearest_along(field.values, field.lower, field.spacing, 0.05, T[None], rays)
    least, at = least[0], at[0]
    passes = 0.5 * np.sin(np.arctan(off / 0.5)) - 0.05
    assert (least[:2] <= 0).all()
    # What is far from it misses the grid.
    assert least[2] == pytest.approx(passes[2], abs=1e-3) and np.isinf(least[3])
    assert at[0] == pytest.approx(0.45, abs=1e-3)


def test_rays_do_not_jump_over_what_is_thin():
    """A rod of 26 cm, 6 mm thick, across a flat square grid, and rays that come in aslant: far from
    the grid its nearest point is nowhere near where they enter."""
    turn = Rotation.from_rotvec([0, np.pi / 4, 0]).as_matrix()
    rod = creation.box((2.6, 0.06, 0.06), similarity(rotation=turn))
    field = distance_field(rod, FieldConfig())
    along, side, ahead = turn[:, 0], turn[:, 2], np.array([0, 0.4, 0])
    look = (side + ahead) / np.linalg.norm(side + ahead)
    T = similarity(
        rotation=np.stack([along, np.cross(look, along), look], axis=1), translation=-0.5 * look
    )
    across = np.linspace(-0.09, 0.09, 19)
    rays = np.stack([across / 0.5, np.zeros(19), np.ones(19)], axis=1)
    least, at = nearest_along(field.values, field.lower, field.spacing, 0.1, T[None], rays)
    least, at = least[0], at[0]
    assert (least < 1e-3).all()
    np.testing.assert_allclose(at, 0.497, atol=2e-3)
