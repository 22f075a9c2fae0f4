"""A stored object with print on it, and a frame that shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from table_scene import MESHES, TABLE, in_camera, photograph, placed, stored

from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.model import search_model
from brrp_cli.registration.verification import Verifier

HERE = np.eye(4)


def printed(points, size):
    """Colours (n, 3) of points (n, 3) on an object: bands and spots that no turn maps to
    themselves."""
    x, y, z = points.T / size
    bands = np.stack([np.sin(4 * x + z), np.sin(5 * y + 1 + x), np.cos(4 * z + 2 * x * y)], axis=-1)
    return (128 + 100 * bands).astype(np.uint8)


def painted(name, light=1.0, noise=0.0, around=HERE):
    """The model with print on it, where it stands, and a frame that shows it in other light, with
    noise, of 255; from a camera that the motion `around` leads to, with `truth` in its frame."""
    model = search_model(stored(name))
    shape, unit = model.stored.shape, model.stored.half_extent
    colours = printed(shape.vertices * unit, unit)
    record = {**model.stored.record, "coloured": True}
    own = replace(model.stored, shape=replace(shape, colours=colours), record=record)
    model = replace(model, stored=own)
    T_cam_mesh = around @ placed(0.0, 0.0, 0.4)
    truth = T_cam_mesh @ similarity(translation=own.center)
    frame = photograph({1: in_camera(MESHES[name](), T_cam_mesh)})
    local = transform_points(np.linalg.inv(truth), np.nan_to_num(frame.points.reshape(-1, 3)))
    rgb = (printed(local, unit) * light).reshape(frame.rgb.shape)
    rgb = np.clip(rgb + np.random.default_rng(1).normal(0, noise, rgb.shape), 0, 255)
    frame = replace(frame, rgb=np.where(frame.segmap[..., None] == 1, rgb, 90).astype(np.uint8))
    points = np.random.default_rng(0).permutation(frame.object_points(1)).astype(np.float64)
    return model, truth, Verifier(points, frame, TABLE)


def turn(*rotvec):
    return similarity(rotation=Rotation.from_rotvec(rotvec).as_matrix())
