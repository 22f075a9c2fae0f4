"""ROS's messages, of the types that rosbags makes from their definitions, become arrays of objects;
the newest is worked on; the node around it names fields that the definitions have."""

from __future__ import annotations

import ast
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from table_scene import SHAPE, T_CAM_WORLD, K, in_camera, photograph

from brrp_cli import Reconstructor
from brrp_cli.errors import FrameError
from brrp_cli.ros import Newest, answer
from brrp_cli.shapes import solids

pytest.importorskip("rosbags")
from rosbags.typesys import Stores, get_typestore

STORES = {"ros1": Stores.ROS1_NOETIC, "ros2": Stores.ROS2_HUMBLE}
NODE = Path(__file__).parents[1] / "tools" / "ros2_node.py"


def packed(store, message, ros1):
    """The message as it arrives: written as bytes and read again."""
    name = message.__msgtype__
    if ros1:
        return store.deserialize_ros1(store.serialize_ros1(message, name), name)
    return store.deserialize_cdr(store.serialize_cdr(message, name), name)


def messages(frame, kind):
    """(color, depth, camera_info) of a frame, as a camera's driver sends them."""
    store, ros1 = get_typestore(STORES[kind]), kind == "ros1"
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=7, nanosec=0)
    more = {"seq": 0} if ros1 else {}
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera", **more)

    def image(array, encoding):
        array = np.ascontiguousarray(array)
        return types["sensor_msgs/msg/Image"](
            header=header, height=array.shape[0], width=array.shape[1], encoding=encoding,
            is_bigendian=0, step=array[0].nbytes, data=array.reshape(-1).view(np.uint8),
        )  # fmt: skip

    roi = types["sensor_msgs/msg/RegionOfInterest"](
        x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
    )
    names = ("D", "K", "R", "P") if ros1 else ("d", "k", "r", "p")
    arrays = [np.zeros(5), K.ravel(), np.eye(3).ravel(), np.zeros(12)]
    info = types["sensor_msgs/msg/CameraInfo"](
        header=header, height=SHAPE[0], width=SHAPE[1], distortion_model="plumb_bob",
        binning_x=0, binning_y=0, roi=roi, **dict(zip(names, arrays, strict=True)),
    )  # fmt: skip
    depth = np.nan_to_num(frame.points[..., 2])
    raw = image(depth.astype(np.float32), "32FC1")
    return [packed(store, each, ros1) for each in (image(frame.rgb, "rgb8"), raw, info)]


@pytest.fixture(scope="module")
def box():
    return in_camera(solids.box(0.10, 0.08, 0.12), T_CAM_WORLD)


@pytest.mark.parametrize("kind", STORES)
def test_messages_become_the_meshes_of_what_stands_there(kind, box):
    (seen,) = answer(Reconstructor(method="vprism"), *messages(photograph({1: box}), kind))
    assert (seen.object_id, seen.name) == (1, "")
    assert seen.vertices.dtype == np.float32 and seen.faces.dtype == np.int32
    assert len(seen.colours) == len(seen.uncertainty) == len(seen.vertices)
    middle = (seen.vertices.min(axis=0) + seen.vertices.max(axis=0)) / 2
    assert middle == pytest.approx(box.bounds.mean(axis=0), abs=0.03)
    corners, colours = seen.triangle_list()
    assert corners.shape == colours.shape == (3 * len(seen.faces), 3)
    assert np.array_equal(corners[3:6], seen.vertices[seen.faces[1]])
    assert colours == pytest.approx(128 / 255, abs=0.01), "the made image is grey"


def test_messages_that_make_no_frame_are_told(box):
    color, depth, info = messages(photograph({1: box}), "ros2")
    with pytest.raises(FrameError, match="Unknown image encoding"):
        answer(Reconstructor(method="vprism"), depth, color, info)


def test_a_stream_goes_on_after_a_frame_that_cannot_be_used(box):
    results = list(Reconstructor(method="vprism").stream([photograph({}), photograph({1: box})]))
    assert isinstance(results[0], FrameError)
    assert [item.object_id for item in results[1].reconstructed] == [1]


def test_the_newest_is_worked_on_and_errors_end_nothing():
    begun, go = threading.Semaphore(0), threading.Semaphore(0)
    given, told = [], []

    def work(number):
        begun.release()
        go.acquire()
        if number == 3:
            raise FrameError("three")
        return 10 * number

    newest = Newest(work, lambda result, messages: given.append((result, messages)), told.append)
    newest.put(1)
    begun.acquire()  # 1 is at work: of 2 and 3 the newer one follows
    newest.put(2)
    newest.put(3)
    go.release()
    begun.acquire()
    newest.put(4)
    go.release()
    begun.acquire()
    go.release()
    newest.close()
    assert given == [(10, (1,)), (40, (4,))]
    assert told == ["three"]


def test_an_error_that_nobody_thought_of_ends_nothing():
    told, given = [], threading.Semaphore(0)

    def work(number):
        return 1 / number

    newest = Newest(work, lambda result, messages: given.release(), told.append)
    newest.put(0)
    while not told:
        time.sleep(0.01)
    newest.put(1)
    assert given.acquire(timeout=10)
    newest.close()
    assert len(told) == 1 and "ZeroDivisionError" in told[0]


def test_the_node_names_fields_and_types_that_ros_has():
    """It cannot run without ROS, but what it says of messages can be held to their definitions."""
    tree = ast.parse(NODE.read_text())
    types = get_typestore(Stores.ROS2_HUMBLE).types
    named = {
        alias.name: types[f"{node.module.replace('.', '/')}/{alias.name}"]
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").endswith(".msg")
        for alias in node.names
    }
    assert set(named) == {"Point", "CameraInfo", "Image", "ColorRGBA", "Marker", "MarkerArray"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            fields = getattr(named.get(node.func.id), "__dataclass_fields__", None)
            assert fields is None or {k.arg for k in node.keywords} <= set(fields), node.func.id
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id == "Marker":
                assert hasattr(named["Marker"], node.attr), node.attr
            if node.value.id == "marker":
                assert node.attr in named["Marker"].__dataclass_fields__, node.attr
    body = next(n for n in tree.body if isinstance(n, ast.FunctionDef))
    imports = sum(isinstance(n, ast.ImportFrom | ast.Import) for n in body.body)
    assert body.end_lineno - body.lineno - imports < 35, "what it does belongs into the package"
