"""Low platforms on a table: found where something lies on them, and things on them told apart."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from bin_scene import YAW, seen

from brrp_cli.config import ObservationConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import transform_points, turn_about_z
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.furniture import Furniture, furniture
from brrp_cli.segmentation.seen_surfaces import see_surfaces
from brrp_cli.segmentation.segment import segment
from brrp_cli.shapes import solids

CONFIG = SegmentConfig()
LENGTH, WIDTH, HEIGHT = 0.4, 0.3, 0.02


def platform(height: float = HEIGHT) -> trimesh.Trimesh:
    return solids.box(LENGTH, WIDTH, height)


def standing(
    size: tuple[float, float, float], x: float, y: float, on: float = HEIGHT
) -> trimesh.Trimesh:
    return solids.moved(solids.box(*size), x=x, y=y, z=on)


THINGS = [
    standing((0.08, 0.06, 0.07), 0.06, 0.03),
    standing((0.12, 0.03, 0.012), -0.08, -0.07),  # flat
    standing((0.06, 0.06, 0.09), 0.0, 0.22, on=0.0),  # beside it
]


def platforms_of(frame: Frame):
    return see_surfaces(frame, 0, CONFIG).table.platforms


def overlaps(frame: Frame) -> list[float]:
    """The best overlap of a mask with each true one."""
    found = segment(frame)
    best = []
    for i in frame.object_ids:
        true = frame.segmap == i
        each = [((found == j) & true).sum() / ((found == j) | true).sum() for j in np.unique(found)]
        best.append(float(max(each)))
    return best


@pytest.mark.parametrize("noise", [0.0, 0.002])
@pytest.mark.parametrize("height", [0.01, HEIGHT, 0.035])
def test_it_is_found_with_its_height(height, noise):
    things = [standing((0.08, 0.06, 0.07), 0.06, 0.03, on=height)]
    (one,) = platforms_of(seen(*things, bin=platform(height), noise=noise))
    assert one.height == pytest.approx(height, abs=0.003 if noise else 0.001)


def test_what_lies_on_it_and_beside_it_has_masks_and_it_has_none():
    frame = seen(*THINGS, bin=platform())
    assert min(overlaps(frame)) > 0.8
    on_it = (see_surfaces(frame, 0, CONFIG).height < 0.004) & (frame.segmap == 0)
    assert (segment(frame)[on_it] > 0).mean() < 0.01


def test_heights_are_above_it_and_beside_it_above_the_table():
    frame = seen(*THINGS, bin=platform())
    surfaces = see_surfaces(frame, 0, CONFIG)
    # Of most of each, seen from above, that is its upper face.
    tops = [np.nanpercentile(surfaces.height[frame.segmap == i], 75) for i in frame.object_ids]
    assert tops == pytest.approx([0.07, 0.012, 0.09], abs=0.002)


def test_an_empty_one_is_a_thing():
    frame = seen(bin=platform())
    assert platforms_of(frame) == ()
    assert segment(frame).max() == 1


def test_a_small_one_is_a_thing_with_another_on_it():
    small = solids.box(0.2, 0.16, 0.03)
    frame = seen(standing((0.06, 0.05, 0.07), 0.0, 0.0, on=0.03), bin=small)
    assert platforms_of(frame) == ()


def test_a_tray_is_a_thing():
    outer = solids.box(LENGTH, WIDTH, 0.035)
    hollow = solids.moved(solids.box(LENGTH - 0.02, WIDTH - 0.02, 0.05), z=0.008)
    tray = solids.difference(outer, hollow)
    thing = standing((0.08, 0.06, 0.07), 0.06, 0.03, on=0.008)
    assert platforms_of(seen(thing, bin=tray)) == ()


def test_one_with_things_over_its_edges_is_no_tray():
    over = [
        standing((0.1, 0.2, 0.06), LENGTH / 2, 0.0),
        standing((0.2, 0.1, 0.06), -0.05, WIDTH / 2),
        standing((0.08, 0.08, 0.06), -LENGTH / 2, -0.08),
    ]
    (one,) = platforms_of(seen(*over, bin=platform()))
    assert one.height == pytest.approx(HEIGHT, abs=0.001)


def around(frame: Frame) -> tuple[Furniture, Plane]:
    plane = scene_plane(frame, ObservationConfig(), 0)
    return furniture(frame, plane, 0, CONFIG), plane


def test_it_is_a_solid_on_the_table():
    frame = seen(*THINGS[:2], bin=platform())
    found, plane = around(frame)
    (solid,) = found.platforms
    assert len(found.solids) == 1
    world = transform_points(frame.T_world_cam, solid) @ turn_about_z(YAW)
    assert np.abs(np.abs(world[:, 0]) - LENGTH / 2).max() < 0.012
    assert np.abs(np.abs(world[:, 1]) - WIDTH / 2).max() < 0.012
    assert sorted(world[:, 2]) == pytest.approx([0.0] * 4 + [HEIGHT] * 4, abs=0.002)
    # Things stand on it, so that it is the plane that they stand on, and the table lies beneath.
    foot = np.array([[0.0, 0.0, 0.0]])
    below = np.linalg.inv(frame.T_world_cam)
    assert plane.signed_distance(transform_points(below, foot)) == pytest.approx(-HEIGHT, abs=0.002)
    assert found.table(plane).signed_distance(transform_points(below, foot)) == pytest.approx(
        0.0, abs=0.002
    )


def test_one_that_has_a_mask_is_an_object():
    frame = seen(*THINGS[:2], bin=platform())
    height = see_surfaces(frame, 0, CONFIG).table.plane.signed_distance(frame.points)
    own = frame.valid & (frame.segmap == 0) & (height > 0.01)
    found, _ = around(frame.with_masks(np.where(own, 9, frame.segmap)))
    assert found.platforms == [] and found.beneath == 0.0
