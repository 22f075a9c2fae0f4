"""An image whose red and blue are exchanged is told by what is stored of the objects in it."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from printed_model import painted, printed
from table_scene import MESHES, in_camera, photograph, placed

from brrp_cli import Reconstructor
from brrp_cli.cli import main
from brrp_cli.frames.npz import save_frame
from brrp_cli.geometry import transform_points
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters
from brrp_cli.reconstruction import Retrieved
from brrp_cli.registration.exchanged_colours import best_aligned, colours_exchanged


def lying(name, light=1.0, noise=0.0):
    """A stored object where it lies, as it is found, and the frame."""
    model, truth, verifier = painted(name, light, noise)
    placed_there = Retrieved(name, 1.0, truth @ model.T_model_object, alignment_score=0.9)
    return (placed_there, model.stored), verifier.frame


def swapped(frame):
    return replace(frame, rgb=np.ascontiguousarray(frame.rgb[..., ::-1]))


@pytest.mark.parametrize("light", [1.0, 0.4])
@pytest.mark.parametrize("name", ["box", "ball", "ell"])
def test_bgr_is_told_from_rgb(name, light):
    found, frame = lying(name, light, noise=20.0)
    assert not colours_exchanged([found], frame)
    assert colours_exchanged([found], swapped(frame))


def test_what_has_no_colours_says_nothing():
    found, frame = lying("box")
    grey = replace(frame, rgb=np.repeat(frame.rgb.mean(axis=2, keepdims=True), 3, axis=2))
    grey = replace(grey, rgb=grey.rgb.astype(np.uint8))
    other = replace(frame, rgb=np.where(frame.segmap[..., None] == 1, 90, frame.rgb // 2 + 60))
    placed_there, stored = found
    bare = placed_there, replace(stored, record={**stored.record, "coloured": False})
    for pairs, image in (([found], grey), ([found], other), ([bare], frame), ([], frame)):
        assert not colours_exchanged(pairs, swapped(image))


def test_what_is_recognised_says_more_than_what_only_fits():
    (placed_there, stored), frame = lying("box")
    swapped_print = replace(
        stored, shape=replace(stored.shape, colours=stored.shape.colours[:, ::-1])
    )
    lookalikes = [(replace(placed_there, weight=0.01), swapped_print)] * 3
    for weight, told in ((0.5, True), (0.95, False)):
        found = [(replace(placed_there, weight=weight), stored), *lookalikes]
        assert colours_exchanged(found, frame) is told
    recognised = replace(placed_there, weight=0.95), stored
    assert colours_exchanged([recognised], swapped(frame))


def test_another_object_of_this_shape_says_nothing():
    """What is printed on it has nothing to do with what is stored."""
    (placed_there, stored), frame = lying("ball")
    rng = np.random.default_rng(0)
    colours = rng.permutation(stored.shape.colours)
    strange = replace(stored, shape=replace(stored.shape, colours=colours))
    assert not colours_exchanged([(placed_there, strange)], frame)
    assert not colours_exchanged([(placed_there, strange)], swapped(frame))


def test_the_object_that_lies_best_is_asked_if_it_lies_well():
    good, better, bad = (Retrieved(str(s), 0.1, alignment_score=s) for s in (0.7, 0.8, 0.5))
    assert best_aligned([good, better, bad]) is better
    assert best_aligned([bad, Retrieved("not tried", 0.9)]) is None


@pytest.fixture(scope="module")
def prior(tmp_path_factory):
    """Of a printed box."""
    meshes = tmp_path_factory.mktemp("meshes")
    mesh = MESHES["box"]().subdivide_to_size(0.004)
    mesh.visual.vertex_colors = printed(mesh.vertices, 0.09)
    mesh.export(meshes / "box.ply")
    out = tmp_path_factory.mktemp("prior") / "prior"
    looks = AppearanceConfig(views=8, rays=500)
    parameters = BuildParameters(samples=1000, dense_points=5000, appearance=looks)
    build_prior(meshes, out, parameters, workers=1)
    return out


@pytest.fixture(scope="module")
def frame():
    """Of the box, in RGB."""
    T_cam_mesh = placed(0.0, 0.0, 0.4)
    frame = photograph({1: in_camera(MESHES["box"](), T_cam_mesh)})
    local = transform_points(np.linalg.inv(T_cam_mesh), np.nan_to_num(frame.points.reshape(-1, 3)))
    colours = printed(local, 0.09).reshape(frame.rgb.shape)
    return replace(frame, rgb=np.where(frame.segmap[..., None] == 1, colours, frame.rgb))


def test_a_session_warns_once_of_bgr_and_not_of_rgb(prior, frame, caplog):
    with caplog.at_level(logging.WARNING), Reconstructor(prior, workers=1) as session:
        assert session(frame).objects[0].recognised.name == "box"
        assert not caplog.messages
        for _ in range(2):
            session(swapped(frame))
    (message,) = caplog.messages
    assert "brrp expects RGB, and OpenCV reads BGR" in message


def test_the_command_warns_of_bgr(prior, frame, tmp_path, caplog):
    told = []
    for name, image in (("rgb", frame), ("bgr", swapped(frame))):
        save_frame(image, tmp_path / f"{name}.npz")
        command = ["reconstruct", tmp_path / f"{name}.npz", "--prior", prior, "-o", tmp_path / name]
        done = CliRunner().invoke(main, [str(each) for each in command])
        assert done.exit_code == 0, done.output
        told.append("OpenCV reads BGR" in caplog.text)
    assert told == [False, True]
