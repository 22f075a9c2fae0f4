"""Solids that a camera has next to no depth of, placed by their masks and a few points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sparse_depth import at_the_edge, in_patches, without_depth
from table_scene import MESHES, PARAMETERS, TABLE, in_camera, photograph, placed, stored

from brrp_cli.config import SearchConfig, SensorConfig
from brrp_cli.config.seen_mask import SeenMaskConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_covariance import pose_covariance
from brrp_cli.registration.pose_search import search
from brrp_cli.registration.scale_scan import observed_cloud
from brrp_cli.registration.seen_mask import seen_mask
from brrp_cli.registration.verification import Verifier

CONFIG, SEARCH, SENSOR = SeenMaskConfig(), SearchConfig(), SensorConfig()
WHERE = placed(0.02, -0.03, 0.6)


def shown(name):
    """The frame of a solid, with all of its depth."""
    return photograph({1: in_camera(MESHES[name](), WHERE)})


def mask_of(frame, plane=TABLE, config=CONFIG):
    return seen_mask(frame, 1, len(frame.object_points(1)), plane, config)


def truth(name):
    """T_cam_model of what stands there."""
    return WHERE @ similarity(translation=stored(name).center)


def off(hypothesis, name):
    """Metres between the true surface and a placed one, on average."""
    model = search_model(stored(name))
    true = transform_points(truth(name), model.surface)
    T_model_cam = np.linalg.inv(hypothesis.T_cam_model)
    return np.abs(model.signed_distance(transform_points(T_model_cam, true))).mean()


def found(name, frame, mask):
    points = np.random.default_rng(0).permutation(frame.object_points(1)).astype(np.float64)
    return search(
        search_model(stored(name)),
        observed_cloud(points, PARAMETERS.features),
        Verifier(points, frame, TABLE, mask),
        PARAMETERS.features,
        SEARCH,
        0,
    )


def test_the_mask_is_asked_where_depth_shows_little_alone():
    frame = shown("box")
    assert mask_of(frame) is None
    assert mask_of(in_patches(frame, 1, 0.7)) is None
    assert mask_of(in_patches(frame, 1, 0.5)) is not None


def test_points_well_inside_the_mask_are_trusted_and_those_at_its_edge_are_not():
    frame = shown("box")
    assert mask_of(in_patches(frame, 1, 0.3)).trust == 1
    assert mask_of(at_the_edge(frame, 1, 30, 0.02)).trust == 0
    explained = np.array([0.9, -0.4])
    edge = mask_of(at_the_edge(frame, 1, 30, 0.02))
    np.testing.assert_array_equal(edge.believed(explained), CONFIG.usual)
    half = replace(edge, trust=0.5)
    np.testing.assert_allclose(half.believed(explained), 0.5 * explained + 0.5 * CONFIG.usual)


def test_nothing_speaks_against_the_truth_and_much_against_a_placement_aside():
    mask, model = mask_of(in_patches(shown("ell"), 1, 0.1)), search_model(stored("ell"))
    aside = np.eye(4)
    aside[0, 3] = 0.03
    there, beside = mask.against(np.stack([truth("ell"), aside @ truth("ell")]), model, 0.003)
    assert there < 0.02
    assert beside > 0.15


@pytest.mark.parametrize("name", ["box", "ell"])
def test_what_few_wrong_points_tell_is_overruled_by_the_mask(name):
    frame = at_the_edge(shown(name), 1, 30, 0.025)
    assert off(found(name, frame, mask_of(frame))[0], name) < 0.002
    assert off(found(name, frame, None)[0], name) > 0.004


def test_a_patch_of_one_face_and_the_mask_together_tell_where_a_box_stands():
    frame = shown("box")
    rows, columns = np.nonzero(frame.segmap == 1)
    middle = int(np.median(rows)), int(np.median(columns))
    patch = np.zeros(frame.shape, dtype=bool)
    patch[middle[0] - 5 : middle[0] + 6, middle[1] - 5 : middle[1] + 6] = True
    frame = without_depth(frame, 1, patch)
    assert off(found("box", frame, mask_of(frame))[0], "box") < 0.001


def test_without_a_plane_the_mask_suggests_no_placement():
    mask = mask_of(in_patches(shown("box"), 1, 0.1), plane=None)
    assert mask.poses(search_model(stored("box"))).shape == (0, 4, 4)


def test_how_far_away_it_stands_is_uncertain_where_no_point_is_trusted():
    model = search_model(stored("box"))
    covariances = []
    for frame in (at_the_edge(shown("box"), 1, 30, 0.0), in_patches(shown("box"), 1, 0.3)):
        points, mask = frame.object_points(1), mask_of(frame)
        covariances.append(
            pose_covariance(truth("box"), model, points, 0.001, SENSOR, mask=mask)[3:, 3:]
        )
    sight = truth("box")[:3, 3] / np.linalg.norm(truth("box")[:3, 3])
    across = np.cross(sight, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    supposed, seen = (np.sqrt(sight @ each @ sight) for each in covariances)
    assert supposed > 0.005 > 0.001 > seen
    assert np.sqrt(across @ covariances[0] @ across) < supposed / 2
