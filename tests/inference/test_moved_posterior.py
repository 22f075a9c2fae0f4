"""A posterior in the frame of a camera that has moved: the same shape, elsewhere."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest
import trimesh
from closed_shapes import at
from scipy.spatial.transform import Rotation
from test_hypothesis_posterior import CENTER, mixed, of_means

from brrp_cli.errors import BrrpError
from brrp_cli.geometry import inverse, moved_box, similarity, transform_points
from brrp_cli.hdf5 import SharedParts
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.methods.posterior_file import open_posterior
from brrp_cli.results.posterior_file import save_posteriors

TURN = Rotation.from_euler("xyz", [0.3, -0.2, 0.5]).as_matrix()
T_NOW_THEN = similarity(rotation=TURN, translation=np.array([0.05, -0.02, 0.1]))


def near_centre(count: int = 500) -> np.ndarray:
    return CENTER + np.random.default_rng(1).uniform(-0.05, 0.05, (count, 3))


def with_a_shape() -> HypothesisPosterior:
    """A placed box, turned, that may also stand elsewhere, and the correction of `mixed`."""
    box = at(trimesh.creation.box((0.04, 0.03, 0.05)), similarity(rotation=TURN.T), name="box")
    box = replace(
        box,
        T_cam_shape=similarity(translation=CENTER) @ box.T_cam_shape,
        covariance=np.diag([1e-4, 4e-4, 9e-4, 1e-6, 4e-6, 9e-6]),
    )
    box = replace(box, alike=box.T_cam_shape[None])
    return of_means([box], np.stack([CENTER - 0.05, CENTER + 0.05]), weights=0.5)


@pytest.mark.parametrize("made", [mixed, with_a_shape])
def test_it_says_at_moved_points_what_it_said_before(made):
    before, points = made(), near_centre()
    now = before.moved(T_NOW_THEN)
    there = transform_points(T_NOW_THEN, points)
    inside = ((points > before.box[0]) & (points < before.box[1])).all(axis=1)
    assert inside.sum() > 10
    np.testing.assert_allclose(now.logits(there), before.logits(points), atol=2e-3)
    found, was = now.probability(there)[inside], before.probability(points)[inside]
    np.testing.assert_allclose(found, was, atol=1e-3)
    assert was.min() < 0.2 and was.max() > 0.8
    # Twice is once, and back is as before.
    half = now.moved(inverse(T_NOW_THEN))
    np.testing.assert_allclose(half.logits(points), before.logits(points), atol=2e-3)


@pytest.mark.parametrize("made", [mixed, with_a_shape])
def test_its_grid_lies_along_the_new_axes(made):
    now = made().moved(T_NOW_THEN)
    low, high = now.bounds
    axes = tuple(np.linspace(a, b, n) for a, b, n in zip(low, high, (7, 8, 9), strict=True))
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    volume = now.probability_volume(axes).ravel()
    within = ((nodes >= low) & (nodes <= high)).all(axis=1)
    np.testing.assert_allclose(volume[within], now.probability(nodes)[within], atol=1e-5)
    np.testing.assert_allclose(now.bounds, moved_box(T_NOW_THEN, made().bounds))


def test_a_placement_is_as_uncertain_as_it_was():
    before = with_a_shape()
    now = before.moved(T_NOW_THEN)
    was, shape = before.means[0], now.means[0]
    np.testing.assert_allclose(shape.deviations, was.deviations, rtol=1e-6)
    np.testing.assert_allclose(shape.alike[0], shape.T_cam_shape)
    np.testing.assert_allclose(shape.vertices, transform_points(T_NOW_THEN, was.vertices))
    # At edges, quotients along other axes are others.
    off = np.abs((was.vertices - CENTER) @ TURN.T / (0.02, 0.015, 0.025))
    vertices = was.vertices[np.sort(off, axis=1)[:, 1] < 0.6]
    assert len(vertices) > 20
    np.testing.assert_allclose(
        now.surface_uncertainty(transform_points(T_NOW_THEN, vertices)),
        before.surface_uncertainty(vertices),
        rtol=0.05,
    )


@pytest.mark.parametrize("made", [mixed, with_a_shape])
def test_a_file_keeps_where_it_is(made, tmp_path):
    now = made().moved(T_NOW_THEN)
    path = tmp_path / "posterior.h5"
    save_posteriors({1: now}, path)
    read = open_posterior(path)[1]
    there = transform_points(T_NOW_THEN, near_centre())
    np.testing.assert_array_equal(read.logits(there), now.logits(there))
    np.testing.assert_array_equal(read.bounds, now.bounds)


@pytest.mark.parametrize("T", [np.eye(3), np.full((4, 4), np.nan)], ids=["3 x 3", "not finite"])
def test_a_file_with_a_broken_transform_is_told(T, tmp_path):
    path = tmp_path / "posterior.h5"
    save_posteriors({1: mixed().moved(T_NOW_THEN)}, path)
    with h5py.File(path, "r+") as file:
        found = []
        file.visititems(lambda _, each: found.append(each) if "T_cam_map" in each.attrs else None)
        found[0].attrs["T_cam_map"] = T
        with pytest.raises(ValueError, match="T_cam_map is no transform"):
            HypothesisPosterior.read(found[0], SharedParts(file))
    with pytest.raises(BrrpError):
        open_posterior(path)
