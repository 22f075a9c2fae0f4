"""The example node without ROS: it can be imported, and answers messages with ROS's fields."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from ros2_node import answer, triangles_of
from table_scene import SHAPE, T_CAM_WORLD, K, in_camera, photograph

from brrp_cli import Reconstructor
from brrp_cli.errors import FrameError
from brrp_cli.shapes import solids


def message(array: np.ndarray, encoding: str) -> SimpleNamespace:
    array = np.ascontiguousarray(array)
    return SimpleNamespace(
        height=array.shape[0], width=array.shape[1], encoding=encoding, is_bigendian=0,
        step=array[0].nbytes, data=array.tobytes(),
    )  # fmt: skip


def test_messages_become_triangles_where_the_object_stands():
    box = in_camera(solids.box(0.10, 0.08, 0.12), T_CAM_WORLD)
    frame = photograph({1: box})
    depth = np.nan_to_num(frame.points[..., 2]).astype(np.float32)
    info = SimpleNamespace(k=K.ravel(), height=SHAPE[0], width=SHAPE[1])
    again = Reconstructor(method="vprism")
    messages = message(frame.rgb, "rgb8"), message(depth, "32FC1"), info
    result = answer(again, *messages)
    (item,) = result.reconstructed
    corners, colours = triangles_of(item.surface)
    assert len(corners) == len(colours) == 3 * len(item.surface.as_trimesh().faces)
    assert corners.mean(axis=0) == pytest.approx(box.vertices.mean(axis=0), abs=0.03)
    assert 0 <= colours.min() <= colours.max() <= 1
    assert result.seconds["masks"] > 0
    second = answer(again, *messages)
    assert np.array_equal(
        second.objects[0].surface.as_trimesh().vertices, item.surface.as_trimesh().vertices
    )


def test_a_stream_goes_on_after_a_frame_that_cannot_be_used():
    empty, full = photograph({}), photograph({1: in_camera(solids.box(0.1, 0.1, 0.1), T_CAM_WORLD)})
    results = list(Reconstructor(method="vprism").stream([empty, full]))
    assert isinstance(results[0], FrameError)
    assert [item.object_id for item in results[1].reconstructed] == [1]
