"""The region around a guess: how far it goes behind what was seen, and where it may not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from made_result import posterior_on

from brrp_cli.config import SurfaceConfig
from brrp_cli.raycast import inside
from brrp_cli.surface.confidence import confidence_surface

CENTER = np.array([0.1, -0.05, 0.8])
# So little is in doubt that the region that the posterior asks for is the cube, to the next node.
HALF, WIDTH, CONFIDENCE = 0.02, 0.0005, 0.9
# The face of a cube towards the camera is all that was seen.
SEEN = CENTER - [0, 0, HALF] + np.mgrid[-8:9, -8:9, 0:1].reshape(3, -1).T * [0.0025, 0.0025, 0]
CONFIG = SurfaceConfig(spacing=0.0025, around_seen=0.01, around_guessed=1.0, around_most=0.05)


def cube(points):
    return (HALF - np.abs(points - CENTER).max(axis=1)) / WIDTH


def nothing(points, radius):
    return np.zeros(len(points), bool)


def everything(points, radius):
    return np.ones(len(points), bool)


@pytest.fixture(scope="module")
def posterior():
    return posterior_on([cube], np.stack([CENTER - 0.05, CENTER + 0.05]), spacing=0.00125)


def region(posterior, free, config=CONFIG, observed=SEEN):
    found = confidence_surface(posterior, observed, CONFIDENCE, config, free=free)
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    assert mesh.is_watertight and mesh.volume > 0
    return mesh


def reached(mesh, way):
    """Metres from the cube's centre to where a ray along an axis leaves the region."""
    steps = np.arange(0, 0.2, 0.0005)
    return steps[inside(mesh, CENTER + steps[:, None] * np.array(way, float))].max()


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_it_goes_beyond_by_what_was_touched_and_a_share_of_the_way_to_what_was_seen(
    posterior, share
):
    """The back face lies 2 HALF behind what was seen."""
    config = replace(CONFIG, around_guessed=share, around_most=0.2)
    mesh = region(posterior, nothing, config)
    behind = HALF + config.around_seen + share * 2 * HALF
    assert reached(mesh, [0, 0, 1]) == pytest.approx(behind, abs=0.0015)
    assert reached(mesh, [0, 0, -1]) == pytest.approx(HALF + config.around_seen, abs=0.0015)


def test_it_goes_no_further_than_most(posterior):
    mesh = region(posterior, nothing, replace(CONFIG, around_most=0.02))
    assert reached(mesh, [0, 0, 1]) == pytest.approx(HALF + 0.02, abs=0.0015)


def test_it_does_not_grow_where_nothing_can_be(posterior):
    mesh = region(posterior, everything)
    for way in np.vstack([np.eye(3), -np.eye(3)]):
        assert reached(mesh, way) == pytest.approx(HALF, abs=0.0015)
    asked = []

    def behind(points, radius):
        asked.append(radius)
        return points[:, 2] > CENTER[2]

    mesh = region(posterior, behind)
    assert set(asked) == {CONFIG.around_seen}
    assert reached(mesh, [0, 0, 1]) == pytest.approx(HALF, abs=0.0015)
    assert reached(mesh, [0, 0, -1]) > HALF + 0.009


def test_what_was_seen_apart_from_the_rest_lies_inside(posterior):
    """A propeller that the posterior makes nothing of; and a stray point metres away does not."""
    apart = CENTER + [0.085, 0, 0] + np.mgrid[-2:3, -2:3, 0:1].reshape(3, -1).T * 0.002
    mesh = region(posterior, nothing, observed=np.vstack([SEEN, apart, CENTER + [0, 0, 5]]))
    assert inside(mesh, apart).all()
    assert mesh.body_count == 2
    wide = trimesh.Trimesh(mesh.vertices, mesh.faces).split()[1].extents
    assert wide == pytest.approx(np.ptp(apart, axis=0) + 2 * CONFIG.around_seen, abs=0.004)


def test_without_a_frame_it_stays_what_the_posterior_asks_for(posterior):
    found = confidence_surface(posterior, SEEN, CONFIDENCE, CONFIG)
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    assert reached(mesh, [0, 0, 1]) == pytest.approx(HALF, abs=0.0015)
