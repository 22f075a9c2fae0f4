import numpy as np
import pytest
import trimesh

from brrp_cli.reconstruction import LOGIT_VARIANCE, METRES, Surface
from brrp_cli.rendering.render import BACKGROUND, PinholeView, fitted, render, view_from_behind
from brrp_cli.surface.colours import scale_top, spread, spread_colours, spread_label

K = np.array([[200.0, 0, 100], [0, 200, 80], [0, 0, 1]])
FRONT = PinholeView(K, np.eye(4), (160, 200))
UP = np.array([0.0, -1.0, 0.0])


def ball(x, y, z, radius):
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    mesh.apply_translation([x, y, z])
    return unsure(mesh, np.zeros(len(mesh.vertices)), METRES)


def unsure(mesh, values, unit):
    return Surface(mesh.vertices, mesh.faces, np.asarray(values, np.float32), unit)


def painted(surface, red, green, blue):
    return np.tile(np.array([red, green, blue, 255], np.uint8), (len(surface.vertices), 1))


def test_a_ball_is_a_disc_of_the_right_size_at_the_right_place():
    surface = ball(0.1, -0.05, 1.0, 0.1)
    picture = render([surface], [painted(surface, 255, 0, 0)], FRONT)
    rows, columns = np.nonzero((picture != BACKGROUND).any(axis=-1))
    assert columns.mean() == pytest.approx(100 + 200 * 0.1, abs=1)
    assert rows.mean() == pytest.approx(80 - 200 * 0.05, abs=1)
    assert len(rows) == pytest.approx(np.pi * 20**2, rel=0.05)


def test_from_behind_the_far_one_hides_the_near_one():
    near, far = ball(0, 0, 0.9, 0.05), ball(0, 0, 1.1, 0.05)
    colours = [painted(near, 255, 0, 0), painted(far, 0, 0, 255)]
    behind = view_from_behind(FRONT, np.array([0, 0, 1.0]), UP)
    in_front = render([near, far], colours, FRONT)[80, 100]
    from_behind = render([near, far], colours, behind)[80, 100]
    assert in_front[0] > 200 and in_front[2] == 0
    assert from_behind[2] > 200 and from_behind[0] == 0


def test_from_behind_left_is_right_and_up_stays_up():
    surface = ball(0.2, -0.1, 1.0, 0.05)
    behind = view_from_behind(FRONT, np.array([0, 0, 1.0]), UP)
    picture = render([surface], [painted(surface, 255, 0, 0)], behind)
    rows, columns = np.nonzero((picture != BACKGROUND).any(axis=-1))
    assert columns.mean() == pytest.approx(100 - 200 * 0.2, abs=1)
    assert rows.mean() == pytest.approx(80 - 200 * 0.1, abs=1)


def test_a_fitted_view_shows_everything_and_fills_the_picture():
    surfaces = [ball(2.0, 0, 2.0, 0.05), ball(2.4, 0.3, 2.0, 0.05)]
    view = fitted(FRONT, surfaces, margin=0.1)
    picture = render(surfaces, [painted(s, 255, 0, 0) for s in surfaces], view)
    rows, columns = np.nonzero((picture != BACKGROUND).any(axis=-1))
    assert columns.min() == pytest.approx(20, abs=2) and columns.max() == pytest.approx(180, abs=2)
    assert rows.min() > 0 and rows.max() < 159


def test_no_surface_gives_an_empty_picture():
    assert (render([], [], FRONT) == BACKGROUND).all()


def test_unsure_is_brighter_than_sure():
    colours = spread_colours(np.array([0.0, 1.0, 2.0]), top=2.0)[:, :3].sum(axis=1)
    assert colours[0] < colours[1] < colours[2]


def test_the_scale_ignores_a_few_outliers_and_an_empty_scene():
    mesh = trimesh.creation.icosphere(subdivisions=3)
    values = np.full(len(mesh.vertices), 0.004)
    values[:5] = 1e6
    assert scale_top([unsure(mesh, values, METRES)]) == pytest.approx(0.004)
    assert scale_top([]) == 1


def test_a_spread_is_a_length_or_the_root_of_a_variance():
    mesh = trimesh.creation.icosphere(subdivisions=1)
    values = np.full(len(mesh.vertices), 0.0025)
    place, logit = unsure(mesh, values, METRES), unsure(mesh, values, LOGIT_VARIANCE)
    np.testing.assert_allclose(spread(place), 0.0025, rtol=1e-6)
    np.testing.assert_allclose(spread(logit), 0.05, rtol=1e-6)
    assert scale_top([place]) == pytest.approx(0.0025)
    assert spread_label(0.0025, [place]) == "2.5 mm"
    assert spread_label(0.05, [logit]) == "0.05"
