"""ROS image messages to arrays and back to frames, by duck typing: messages of rclpy, rospy and
rosbags have the same fields. No ROS is needed.

REP 118: depth 16UC1 is millimetres with 0 for no return, 32FC1 metres with NaN; z, not ray length.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.pixels import decode, decode_colour

# encoding -> (type, channels, the channels that are red, green and blue)
_COLOUR: dict[str, tuple[int, tuple[int, int, int]]] = {
    "rgb8": (3, (0, 1, 2)),
    "bgr8": (3, (2, 1, 0)),
    "8UC3": (3, (2, 1, 0)),  # OpenCV's order
    "rgba8": (4, (0, 1, 2)),
    "bgra8": (4, (2, 1, 0)),
    "mono8": (1, (0, 0, 0)),
}
_DEPTH = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
# compressedDepth puts a header of three numbers before its PNG.
_DEPTH_HEADER = 12


def is_depth(message: Any) -> bool:
    """Whether an Image or CompressedImage message holds depth, by its encoding."""
    encoding = getattr(message, "encoding", "") or getattr(message, "format", "")
    return any(name in encoding for name in _DEPTH) or "compressedDepth" in encoding


def colour_of(message: Any) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 RGB of an Image or CompressedImage message. Errors: FrameError."""
    if not hasattr(message, "encoding"):
        return decode_colour(io.BytesIO(bytes(message.data)))
    if message.encoding not in _COLOUR:
        raise _unknown(message.encoding, ", ".join(_COLOUR))
    channels, order = _COLOUR[message.encoding]
    return _rows(message, np.dtype(np.uint8), channels)[..., list(order)]


def depth_of(message: Any) -> NDArray[Any]:
    """(H, W) depth of an Image or CompressedImage message: uint16 millimetres or float metres.

    Errors: FrameError
    """
    if not hasattr(message, "encoding"):
        data = bytes(message.data)
        if "32FC1" in message.format:
            raise _unknown(message.format, "16UC1; compressedDepth", "record the raw depth topic")
        header = _DEPTH_HEADER if "compressedDepth" in message.format else 0
        return decode(io.BytesIO(data[header:]), None)[0]
    if message.encoding not in _DEPTH:
        raise _unknown(message.encoding, ", ".join(_DEPTH))
    order = ">" if message.is_bigendian else "<"
    return _rows(message, np.dtype(order + _DEPTH[message.encoding]), 1)[..., 0]


def intrinsics_of(info: Any) -> NDArray[np.float64]:
    """K (3, 3) of a CameraInfo message, ROS 1 (`K`) or ROS 2 (`k`). Errors: FrameError if it is
    not calibrated."""
    K = np.array(info.k if hasattr(info, "k") else info.K, dtype=np.float64).reshape(3, 3)
    if K[0, 0] == 0:
        raise FrameError(
            "The camera_info is not calibrated",
            expected="K with a focal length (REP 104)",
            found="K[0] = 0",
        )
    return K


def frame_of(color: Any, depth: Any, info: Any, *, depth_scale: float | None = None) -> Frame:
    """A frame without masks of three messages of one camera: colour, depth aligned to it and the
    colour camera's camera_info.

    Errors: FrameError, also where the sizes disagree: depth that is not aligned has another.
    """
    rgb, raw = colour_of(color), depth_of(depth)
    sizes = {"colour": rgb.shape[:2], "depth": raw.shape[:2], "camera_info": _size(info)}
    if len(set(sizes.values())) > 1:
        raise FrameError(
            "The sizes disagree",
            expected="colour, depth and camera_info of one camera at one resolution",
            found=", ".join(f"{name} {w} x {h}" for name, (h, w) in sizes.items()),
            fix="align depth to colour: realsense2_camera align_depth.enable:=true and its topic"
            " aligned_depth_to_color; depth_image_proc/register for others",
        )
    return make_frame(rgb=rgb, depth=raw, K=intrinsics_of(info), depth_scale=depth_scale)


def _size(info: Any) -> tuple[int, int]:
    return int(info.height), int(info.width)


def _rows(message: Any, kind: np.dtype[Any], channels: int) -> NDArray[Any]:
    """(H, W, C) of the message's bytes, whose rows may be longer than the image."""
    data = np.frombuffer(bytes(message.data), np.uint8)
    length = message.width * channels * kind.itemsize
    if message.step < length or data.size < message.step * message.height:
        raise FrameError(
            "The image message is cut short",
            expected=f"{message.height} rows of {length} bytes",
            found=f"{data.size} bytes, step {message.step}",
        )
    rows = data[: message.step * message.height].reshape(message.height, message.step)[:, :length]
    pixels = np.ascontiguousarray(rows).view(kind)
    return pixels.reshape(message.height, message.width, channels).astype(kind.newbyteorder("="))


def _unknown(encoding: str, expected: str, fix: str | None = None) -> FrameError:
    return FrameError("Unknown image encoding", expected=expected, found=encoding, fix=fix)
