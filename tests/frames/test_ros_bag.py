"""ROS bags that rosbags writes, ROS 1 and ROS 2, read back as frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from for_people import assert_for_people

from brrp_cli.cli import main
from brrp_cli.errors import FrameError
from brrp_cli.frames.format import FrameRequest
from brrp_cli.frames.readers import list_frames, read_frame

rosbags = pytest.importorskip("rosbags")
from rosbags.rosbag1 import Writer as Writer1  # noqa: E402
from rosbags.rosbag2 import Writer as Writer2  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

SECOND = 10**9


def messages(scene, store, ros1):
    """(topic, type, nanoseconds, message): two colour images, depth near each, and camera_info."""
    types = store.types
    time_type = types["builtin_interfaces/msg/Time"]

    def header(time):
        stamp = time_type(sec=time // SECOND, nanosec=time % SECOND)
        more = {"seq": 0} if ros1 else {}
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera", **more)

    def image(time, array, encoding):
        array = np.ascontiguousarray(array)
        return types["sensor_msgs/msg/Image"](
            header=header(time), height=array.shape[0], width=array.shape[1], encoding=encoding,
            is_bigendian=0, step=array[0].nbytes, data=array.reshape(-1).view(np.uint8),
        )  # fmt: skip

    roi = types["sensor_msgs/msg/RegionOfInterest"](
        x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
    )
    names = ("D", "K", "R", "P") if ros1 else ("d", "k", "r", "p")
    arrays = [np.zeros(5), scene.K.ravel(), np.eye(3).ravel(), np.zeros(12)]
    camera = types["sensor_msgs/msg/CameraInfo"](
        header=header(SECOND), height=120, width=160, distortion_model="plumb_bob",
        binning_x=0, binning_y=0, roi=roi, **dict(zip(names, arrays, strict=True)),
    )  # fmt: skip
    z = np.where(np.isfinite(scene.depth), scene.depth, 0)
    depth = (z * 1000).round().astype(np.uint16)
    kind = "sensor_msgs/msg/Image"
    base = "/camera/color"
    aligned = "/camera/aligned_depth_to_color/image_raw"
    yield f"{base}/camera_info", "sensor_msgs/msg/CameraInfo", SECOND, camera
    for number, time in enumerate((SECOND, 2 * SECOND)):
        rgb = scene.rgb if number == 0 else scene.rgb // 2
        yield f"{base}/image_raw", kind, time, image(time, rgb, "rgb8")
        late = time + SECOND // 100
        yield aligned, kind, late, image(late, depth, "16UC1")
        raw = np.ones((60, 80), np.uint16)
        yield "/camera/depth/image_rect_raw", kind, late, image(late, raw, "16UC1")


def write(
    scene, path: Path, ros1: bool, leave_out: str = "nothing", silent: str = "nothing"
) -> Path:
    """A bag without topics of the name `leave_out`, and without messages of those of `silent`."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    with Writer1(path) if ros1 else Writer2(path, version=9) as writer:
        connections = {}
        for topic, kind, time, message in messages(scene, store, ros1):
            if leave_out in topic:
                continue
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            if silent not in topic:
                writer.write(connections[topic], time, serialize(message, kind))
    return path


@pytest.fixture(params=["ros1", "ros2"])
def bag(request, scene, tmp_path):
    ros1 = request.param == "ros1"
    return write(scene, tmp_path / ("a.bag" if ros1 else "bag"), ros1)


def test_a_bag_is_read_with_the_depth_that_is_aligned(scene, bag):
    frame = read_frame(bag)
    assert np.array_equal(frame.rgb, scene.rgb)
    assert pytest.approx(scene.K) == frame.K
    seen = np.isfinite(scene.depth)
    assert np.array_equal(frame.valid, seen)
    assert frame.points[seen][:, 2] == pytest.approx(scene.depth[seen], abs=6e-4)
    assert np.array_equal(read_frame(bag, request=FrameRequest(index="1")).rgb, scene.rgb // 2)
    with pytest.raises(FrameError, match="no such frame"):
        read_frame(bag, request=FrameRequest(index="2"))


def test_depth_of_another_camera_is_refused(bag):
    request = FrameRequest(depth_topic="/camera/depth/image_rect_raw")
    with pytest.raises(FrameError, match=r"sizes disagree(.|\n)*80 x 60(.|\n)*align"):
        read_frame(bag, request=request)


def test_topics_that_are_not_there_are_listed(bag):
    with pytest.raises(FrameError, match=r"color topic is not clear(.|\n)*/camera/color/image_raw"):
        read_frame(bag, request=FrameRequest(color_topic="/left"))


def test_a_bag_without_depth_and_a_damaged_one_are_told(scene, tmp_path):
    with pytest.raises(FrameError, match="no depth topic"):
        read_frame(write(scene, tmp_path / "c.bag", True, leave_out="depth"))
    (tmp_path / "d.bag").write_bytes(b"#ROSBAG V2.0\njunk")
    with pytest.raises(FrameError, match="bag cannot be read") as caught:
        read_frame(tmp_path / "d.bag")
    assert_for_people(caught.value)


@pytest.mark.parametrize("ros1", [True, False], ids=["ros1", "ros2"])
def test_a_damaged_bag_is_read_or_refused(scene, tmp_path, ros1):
    path = write(scene, tmp_path / ("a.bag" if ros1 else "bag"), ros1)
    file = path if ros1 else next(path.glob("*.db3"))
    whole, rng = file.read_bytes(), np.random.default_rng(0)
    # Headers and indices are a small part of it: half of the bits are flipped among them.
    ends = [*range(4000), *range(len(whole) - 4000, len(whole))]
    places = [*rng.integers(len(whole), size=8), *rng.choice(ends, 8)]
    for place in places:
        data = bytearray(whole)
        data[place] ^= 1 << rng.integers(8)
        file.write_bytes(data)
        try:
            read_frame(path)
        except FrameError:
            continue
    for part in range(8):
        file.write_bytes(whole[: len(whole) * part // 8])
        with pytest.raises(FrameError):
            read_frame(path)
    for index in ("abc", "²", "-1", 5000 * "9"):
        with pytest.raises(FrameError):
            read_frame(path, request=FrameRequest(index=index))


def test_a_bag_says_what_it_holds(bag):
    assert list_frames(bag) == ["0", "1"]
    result = CliRunner().invoke(main, ["frame", str(bag), "--list"])
    assert result.exit_code == 0, result.output
    assert "2 frames" in result.output
    assert "/camera/color/image_raw: 2 Image" in result.output
    assert "/camera/color/camera_info: 1 CameraInfo" in result.output


def test_topics_without_messages_are_told(scene, tmp_path):
    path = write(scene, tmp_path / "no_info", ros1=False, silent="camera_info")
    with pytest.raises(FrameError, match="no camera_info") as told:
        read_frame(path)
    assert "/camera/color/camera_info" in str(told.value)
