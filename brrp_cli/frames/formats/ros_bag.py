"""ROS bags, ROS 1 (.bag) and ROS 2 (a folder with metadata.yaml, .db3 or .mcap), by `rosbags`.

RealSense recordings (.bag of the Viewer) are ROS 1 bags, but their depth is not aligned to colour.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from brrp_cli.errors import BrrpError, DependencyError, FrameError
from brrp_cli.files import trouble_of
from brrp_cli.frames.format import Format, FrameRequest, as_number
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.ros_images import frame_of, is_depth

log = logging.getLogger(__name__)

_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_INFO = "sensor_msgs/msg/CameraInfo"
_APART = 0.05  # seconds between a colour image and the depth that belongs to it
_RECORDED_APART = 2 * 10**9  # nanoseconds between the two in the bag


@dataclass(frozen=True)
class _Choice:
    color: str
    depth: str
    info: str


def read(path: Path, request: FrameRequest) -> Frame:
    """The colour image that --index counts, from 0, with the depth that is nearest in time.

    Topics are found by name and encoding; where several would do, --color-topic and --depth-topic
    have to name them. Errors: FrameError; DependencyError without `rosbags`.
    """
    request.refuse(path, "the bag's camera_info", intrinsics="--intrinsics")
    index = as_number(request.index or "0")
    if index is None:
        raise FrameError(
            "A bag's frames are counted", where=path, expected="0, 1, ...", found=request.index
        )
    with _damage_told(path), _opened(path) as reader:
        choice = _choose(reader, request, path)
        log.info("Topics: %s, %s, %s", choice.color, choice.depth, choice.info)
        info = next((message for _, message in _messages(reader, choice.info)), None)
        if info is None:
            raise FrameError(
                "The bag has no camera_info",
                where=path,
                expected=f"a message of {choice.info}",
                found="the topic, without one",
                fix="record it too",
            )
        times = _times(reader, choice.color)
        if index >= len(times):
            raise FrameError(
                "The bag has no such frame",
                where=path,
                expected=f"0 to {len(times) - 1}" if times else "a colour image",
                found=f"--index {index}",
            )
        time = times[index]
        # Of messages with one time of recording the one that is as far from the first of them.
        same = times[:index].count(time)
        color = next(islice(_messages(reader, choice.color, time, time + 1), same, None))
        # A recorder writes what was taken at one moment within this time.
        near = _messages(reader, choice.depth, time - _RECORDED_APART, time + _RECORDED_APART)
        depth = min(near, key=lambda pair: abs(_stamp(pair) - _stamp(color)), default=None)
        if depth is None or abs(_stamp(depth) - _stamp(color)) > _APART:
            raise FrameError(
                "No depth image is near the colour image in time",
                where=path,
                expected=f"within {_APART} s",
                found="none" if depth is None else f"{abs(_stamp(depth) - _stamp(color)):.3f} s",
            )
        try:
            frame = frame_of(color[1], depth[1], info, depth_scale=request.depth_scale)
        except FrameError as error:
            error.where = path
            raise
    return Frame(frame.rgb, frame.points, frame.segmap, frame.K, source=path)


def names(path: Path, request: FrameRequest) -> list[str]:
    """The numbers of the colour images. Errors: as of `read`."""
    with _damage_told(path), _opened(path) as reader:
        color = _choose(reader, request, path).color
        return [str(number) for number in range(len(_times(reader, color)))]


def contents(path: Path, request: FrameRequest) -> list[str]:
    """The topics, with the type and the number of their messages. Errors: as of `read`."""
    with _damage_told(path), _opened(path) as reader:
        return [
            f"{topic}: {about.msgcount} {(about.msgtype or 'of several types').rpartition('/')[2]}"
            for topic, about in sorted(reader.topics.items())
        ]


@contextmanager
def _damage_told(path: Path) -> Iterator[None]:
    try:
        yield
    except BrrpError:
        raise
    except Exception as error:  # the library's errors have no common base
        raise FrameError(
            "The bag cannot be read",
            where=path,
            expected="a whole ROS 1 .bag, or a ROS 2 bag's folder with metadata.yaml",
            found=trouble_of(error),
            fix="reindex it: rosbag reindex (ROS 1), ros2 bag reindex (ROS 2)",
        ) from error


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise DependencyError(
            "Reading ROS bags needs the library rosbags",
            where=path,
            found=error,
            fix="pip install 'brrp-cli[ros]'",
        ) from error
    # Older ROS 2 bags do not bring the definitions of their messages.
    folder = path if path.is_dir() or path.suffix == ".bag" else path.parent
    reader = AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
    reader.open()
    try:
        yield reader
    finally:
        reader.close()


def _messages(
    reader: Any, topic: str, start: int | None = None, stop: int | None = None
) -> Iterator[tuple[int, Any]]:
    """(time of recording, message) of a topic, from `start` until before `stop`, nanoseconds."""
    for connection, time, raw in reader.messages(_connections(reader, topic), start, stop):
        yield time, reader.deserialize(raw, connection.msgtype)


def _connections(reader: Any, topic: str) -> list[Any]:
    return [one for one in reader.connections if one.topic == topic]


def _times(reader: Any, topic: str) -> list[int]:
    """When the messages of a topic were recorded, nanoseconds; they stay packed."""
    return [time for _, time, _ in reader.messages(_connections(reader, topic))]


def _stamp(pair: tuple[int, Any]) -> float:
    """Seconds: of the header, or, where a driver left that empty, of the record."""
    stamp = pair[1].header.stamp
    seconds = stamp.sec + stamp.nanosec * 1e-9
    return seconds if seconds > 0 else pair[0] * 1e-9


def _choose(reader: Any, request: FrameRequest, path: Path) -> _Choice:
    topics = {one.topic: one.msgtype for one in reader.connections}
    images = [topic for topic, kind in topics.items() if kind in _IMAGES]
    depths = [t for t in images if is_depth(next(_messages(reader, t), (0, None))[1])]
    colors = [t for t in images if t not in depths and "infra" not in t]
    listing = ", ".join(f"{topic} ({kind.rpartition('/')[2]})" for topic, kind in topics.items())
    color = _one(colors, request.color_topic, "--color-topic", (), path, listing)
    # Of depth topics the one that is aligned to colour, where a driver writes both.
    aligned = ("aligned_depth_to_color", "depth_registered", "depth_to_rgb")
    depth = _one(depths, request.depth_topic, "--depth-topic", aligned, path, listing)
    infos = [topic for topic, kind in topics.items() if kind == _INFO]
    base = color.rpartition("/")[0]
    beside = [t for t in infos if base.startswith(t.rpartition("/")[0])]
    return _Choice(color, depth, _one(beside or infos, None, "", (), path, listing))


def _one(
    found: list[str],
    named: str | None,
    option: str,
    preferred: tuple[str, ...],
    path: Path,
    listing: str,
) -> str:
    if named is not None and named in found:
        return named
    best = [topic for topic in found if any(word in topic for word in preferred)] or found
    if named is None and len(best) == 1:
        return best[0]
    what = option.removeprefix("--").removesuffix("-topic") or "camera_info"
    raise FrameError(
        f"The bag's {what} topic is not clear" if found else f"The bag has no {what} topic",
        where=path,
        expected=", ".join(found) or f"a topic with {what}",
        found=f"{named}; all topics: {listing}" if named else f"all topics: {listing}",
        fix=f"name it: {option} TOPIC" if option and found else None,
    )


FORMAT = Format(
    title="a ROS bag",
    layout="NAME.bag, or a folder with metadata.yaml",
    matches=lambda path: (
        (path.is_file() and path.suffix in (".bag", ".db3", ".mcap"))
        or (path / "metadata.yaml").is_file()
    ),
    read=read,
    names=names,
    contents=contents,
)
