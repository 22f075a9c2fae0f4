"""A frame is more probable with the placement that it shows than with any other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import MESHES, T_CAM_WORLD, TABLE, in_camera, photograph, placed, stored

from brrp_cli.config import ColourConfig, LikelihoodConfig, SensorConfig
from brrp_cli.geometry import similarity
from brrp_cli.observation.pixel_noise import pixel_noise
from brrp_cli.registration.likelihood import (
    PlacementEvidence,
    evidence,
    log_likelihood,
    misfit,
    see,
)
from brrp_cli.registration.model import search_model
from brrp_cli.shapes import solids

ID, OTHER = 5, 6
CONFIG, SENSOR, COLOUR = LikelihoodConfig(), SensorConfig(), ColourConfig()
WHERE = (0.0, 0.0, 0.5)


def noisy(frame, deviation=0.001):
    rng = np.random.default_rng(0)
    error = deviation * rng.normal(size=(*frame.shape, 1)) / frame.points[..., 2:]
    return replace(frame, points=(frame.points * (1 + error)).astype(np.float32))


def seen_in(frame, plane=TABLE):
    noise = pixel_noise(frame, plane, SENSOR)
    return see(frame, ID, plane, noise, SENSOR.patch, SENSOR.bleed, CONFIG)


def truth(model, where=WHERE):
    """T_cam_model of what stands there."""
    return placed(*where) @ similarity(translation=model.stored.center)


def shifted(T, x=0.0, y=0.0, z=0.0):
    """By metres along the world's axes."""
    moved = T.copy()
    moved[:3, 3] += T_CAM_WORLD[:3, :3] @ [x, y, z]
    return moved


def look_at(name, T, seen):
    return evidence(T, search_model(stored(name)), seen, CONFIG, COLOUR)


def nats(name, T, seen):
    return log_likelihood(look_at(name, T, seen), CONFIG)


@pytest.fixture(scope="module")
def ball():
    return seen_in(noisy(photograph({ID: in_camera(MESHES["ball"](), placed(*WHERE))})))


@pytest.mark.parametrize("shift", [(0.005, 0, 0), (-0.005, 0, 0), (0, 0.005, 0), (0, 0, 0.005)])
def test_a_ball_is_where_it_was_rendered_and_not_five_millimetres_off(ball, shift):
    T = truth(search_model(stored("ball")))
    assert nats("ball", T, ball) > nats("ball", shifted(T, *shift), ball) + 1


def test_the_true_placement_beats_none_of_them_and_another_shape_does_not(ball):
    assert nats("ball", truth(search_model(stored("ball"))), ball) > 3
    # As near as a box comes to a ball of its size.
    box = truth(search_model(stored("box")))
    assert max(nats("box", shifted(box, x, y), ball) for x in (0, 0.02) for y in (0, 0.02)) < -3


def test_residuals_are_the_sensors_and_so_are_votes(ball):
    T = truth(search_model(stored("ball")))
    found = look_at("ball", T, ball)
    assert np.abs(found.residual).max() < 0.002
    # The visible disc of the ball, less its rim.
    area = found.share.sum() * SENSOR.patch**2
    assert 0.4 * np.pi * 0.05**2 < area < np.pi * 0.05**2
    assert found.missed == 0 and found.free == 0 and found.below < 0.02
    correlated = replace(ball, patches_per_vote=4 * ball.patches_per_vote)
    other = look_at("ball", T, correlated)
    assert other.covered == pytest.approx(found.covered / 4)
    beside = shifted(T, x=0.005)
    less, more = (nats("ball", T, seen) - nats("ball", beside, seen) for seen in (correlated, ball))
    assert 0 < less < more


def test_a_shape_that_is_off_by_little_everywhere_is_told_by_its_misfit():
    """As far as patches err independently, and no further than `most_deviations`."""

    def of(deviations, patches_per_vote=1.0):
        off = np.asarray(deviations) * 0.001
        return PlacementEvidence(
            off, 0 * off + 1e-6, 0 * off + 1, patches_per_vote, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        )

    assert misfit(of([2.0, -2.0]), CONFIG) == pytest.approx(2)
    assert misfit(of([2.0, -2.0], 4.0), CONFIG) == pytest.approx(0.5)
    assert misfit(of([0.0, 50.0]), CONFIG) == pytest.approx(CONFIG.most_deviations / 2)
    noise = np.random.default_rng(0).standard_normal(20_000)
    assert misfit(of(noise), CONFIG) == pytest.approx(misfit(of([]), CONFIG), rel=0.02)
    retrieved = replace(CONFIG, depth=0.0)
    assert log_likelihood(of([1.5] * 9), retrieved) == pytest.approx(
        log_likelihood(of([0.5] * 9), retrieved) - CONFIG.misfit
    )


def test_however_many_patches_there_are_they_count_as_so_many_votes():
    def of(count):
        flat = np.zeros(count)
        return log_likelihood(
            PlacementEvidence(flat, flat + 1e-6, flat + 1, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            CONFIG,
        )

    each = of(1) * (1 + 1 / CONFIG.most_votes) - CONFIG.base / CONFIG.most_votes - CONFIG.base
    assert of(1) < of(10) < of(10_000) < CONFIG.base + CONFIG.most_votes * each


def test_surface_where_the_camera_saw_past_it_speaks_against(ball):
    T = truth(search_model(stored("ball")))
    # Twice as large about its foot: half of it is in space that was seen to be free.
    grown = placed(*WHERE) @ similarity(2.0) @ similarity(translation=[0, 0, 0.05])
    found = look_at("ball", grown, ball)
    assert found.free > 1 and found.missed == 0
    small = look_at("ball", T @ similarity(0.5), ball)
    assert small.missed > 1 and small.free == 0


def test_another_object_in_front_excuses():
    """A box whose lower part is hidden by another one is not missing there."""
    model = search_model(stored("box"))
    toward = np.linalg.inv(T_CAM_WORLD)[:2, 3]
    toward = 0.1 * toward / np.linalg.norm(toward)
    hidden = {
        ID: in_camera(MESHES["box"](), placed(*WHERE)),
        OTHER: in_camera(solids.box(0.12, 0.02, 0.06), placed(*toward, 0.7)),
    }
    found = look_at("box", truth(model), seen_in(photograph(hidden)))
    assert found.free == 0 and found.missed == 0
    # Where nothing hides it and the table is seen, it is.
    alone = photograph(
        {ID: in_camera(solids.moved(solids.box(0.1, 0.06, 0.07), z=0.07), placed(*WHERE))}
    )
    assert look_at("box", truth(model), seen_in(alone)).free > 0.5


def test_what_is_measured_where_the_mask_ends_speaks_against_in_the_surroundings_colours():
    """Depth goes on beside half of a box as the placed box does, and no mask holds that. It is
    other than the object if it has the table's colours; with the box's, the mask has lost it."""
    model = search_model(stored("box"))
    frame = photograph({ID: in_camera(MESHES["box"](), placed(*WHERE))})
    whole = frame.segmap == ID
    left = whole & (np.arange(frame.shape[1]) < np.nonzero(whole)[1].mean())
    half = replace(frame, segmap=np.where(left, 0, frame.segmap))
    rgb = np.full((*frame.shape, 3), 120, np.uint8)
    rgb[whole & ~left] = [200, 40, 40]
    other = look_at("box", truth(model), seen_in(replace(half, rgb=rgb)))
    rgb[left] = [200, 40, 40]
    lost = look_at("box", truth(model), seen_in(replace(half, rgb=rgb)))
    assert other.free == lost.free == 0
    assert other.unmasked > 0.5 * other.covered
    assert lost.unmasked < 0.1 * other.unmasked
    assert log_likelihood(other, CONFIG) < log_likelihood(lost, CONFIG) - 3
    assert look_at("box", truth(model), seen_in(replace(frame, rgb=rgb))).unmasked == 0


def test_what_lies_under_the_table_speaks_against(ball):
    T = truth(search_model(stored("ball")))
    assert look_at("ball", shifted(T, z=-0.03), ball).below > 0.1
    assert look_at("ball", shifted(T, z=-0.03), replace(ball, plane=None)).below == 0


def test_a_placement_behind_the_camera_or_beside_the_image_explains_nothing(ball):
    T = truth(search_model(stored("ball")))
    for there in ((0, 0, -1.0), (3.0, 0, 1.0)):
        away = T.copy()
        away[:3, 3] = there
        found = look_at("ball", away, ball)
        assert not len(found.residual) and found.covered == 0 and found.missed > 1
        assert log_likelihood(found, CONFIG) < -3


def test_without_depth_nothing_is_said():
    frame = photograph({ID: in_camera(MESHES["ball"](), placed(*WHERE))})
    points = frame.points.copy()
    rows, columns = np.nonzero(frame.segmap == ID)
    points[rows[:-20], columns[:-20]] = np.nan
    found = look_at(
        "ball", truth(search_model(stored("ball"))), seen_in(replace(frame, points=points))
    )
    assert found.missed == found.free == 0
    assert abs(log_likelihood(found, CONFIG) - CONFIG.base) < 1
