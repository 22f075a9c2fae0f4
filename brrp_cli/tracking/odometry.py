"""Where a camera was that does not tell it: found from the images, frame after frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import OdometryConfig, TrackConfig
from brrp_cli.dependencies import import_open3d, one_openmp_thread
from brrp_cli.frames.dilate import dilated
from brrp_cli.frames.frame import BACKGROUND, Frame, StreamPose
from brrp_cli.frames.projection import depth_behind, pixel_numbers
from brrp_cli.geometry import inverse, rotation_angle, transform_points
from brrp_cli.tracking.motion import background_stands, noisier

Array = NDArray[np.float64]


class Odometry:
    """The poses of one stream's frames, from the first one on.

    Each frame is held to a key frame, so that errors do not add up from frame to frame; one that
    the camera has left too far behind is replaced.
    """

    def __init__(self, config: TrackConfig) -> None:
        self._config = config
        self._streams = 0
        # The frame that others are held to, and the one whose pose was found last.
        self._key: Frame | None = None
        self._at: Frame | None = None
        # T_now_last (4, 4) of the last two.
        self._step = np.eye(4)

    def __call__(self, frame: Frame, last: Frame | None) -> Frame:
        """The frame with its `stream_pose`; as it is if it tells where its camera was.

        last : the frame before it, with masks and its own pose; None = there is none
        """
        own = self._config.odometry
        if own is None or frame.T_world_cam is not None:
            return frame
        if self._at is None or last is None or last.stream_pose is None or not _alike(last, frame):
            return self._begun(frame)
        if background_stands(self._at, frame, self._config):
            self._step = np.eye(4)
            return replace_pose(frame, self._at.stream_pose)
        if self._key is None or self._key.stream_pose is None or _far(self._key, last, own):
            self._key = last
        held_to = ((self._key, self._step @ _between(self._key, last)), (last, np.eye(4)))
        for steps, (key, guess) in product((own.begun, own.steps), held_to):
            T_now_key = motion(key, frame, guess, steps, own)
            if T_now_key is None or _wrong(key, frame, T_now_key, self._config) > own.wrong:
                continue
            assert key.stream_pose is not None
            pose = replace(
                key.stream_pose, T_stream_cam=key.stream_pose.T_stream_cam @ inverse(T_now_key)
            )
            self._key, self._at = key, replace_pose(frame, pose)
            self._step = _between(last, self._at)
            return self._at
        return self._begun(frame)

    def _begun(self, frame: Frame) -> Frame:
        """The first frame of another stream: nothing is known of how it lies to those before."""
        self._streams += 1
        self._at = replace_pose(frame, StreamPose(self._streams, np.eye(4)))
        self._key, self._step = None, np.eye(4)
        return self._at


def replace_pose(frame: Frame, pose: StreamPose | None) -> Frame:
    """The same image from elsewhere in a stream."""
    moved = frame.with_masks(frame.segmap, frame.aside, frame.corrected)
    object.__setattr__(moved, "stream_pose", pose)
    return moved


def motion(
    then: Frame, now: Frame, guess: Array, steps: Sequence[int], config: OdometryConfig
) -> Array | None:
    """T_now_then (4, 4) of two images of one camera of things at rest, by Open3D (colour and depth
    together, Park et al., ICCV 2017); None where it finds none.

    steps : as of `OdometryConfig`
    """
    o3d = import_open3d()
    odometry = o3d.pipelines.odometry
    # Sums of several threads change their last bits from run to run.
    with one_openmp_thread():
        found, T_now_then, _ = odometry.compute_rgbd_odometry(
            _image(then, config),
            _image(now, config),
            _intrinsics(now),
            guess,
            odometry.RGBDOdometryJacobianFromHybridTerm(),
            odometry.OdometryOption(o3d.utility.IntVector(steps)),
        )
    return np.array(T_now_then) if found and np.isfinite(T_now_then).all() else None


def _image(frame: Frame, config: OdometryConfig) -> Any:
    geometry = import_open3d().geometry
    depth = np.nan_to_num(frame.depth, nan=0.0)
    return geometry.RGBDImage.create_from_color_and_depth(
        geometry.Image(np.ascontiguousarray(frame.rgb)),
        geometry.Image(depth),
        depth_scale=1.0,
        depth_trunc=config.reach,
        convert_rgb_to_intensity=True,
    )


def _intrinsics(frame: Frame) -> Any:
    height, width = frame.shape
    K = frame.K
    return import_open3d().camera.PinholeCameraIntrinsic(
        width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2]
    )


def _alike(one: Frame, other: Frame) -> bool:
    """Whether two frames are of one camera."""
    return one.shape == other.shape and np.allclose(one.K, other.K)


def _between(then: Frame, now: Frame) -> Array:
    """T_now_then (4, 4) of two frames of one stream."""
    assert then.stream_pose is not None and now.stream_pose is not None
    return inverse(now.stream_pose.T_stream_cam) @ then.stream_pose.T_stream_cam


def _far(key: Frame, last: Frame, config: OdometryConfig) -> bool:
    assert key.stream_pose is not None and last.stream_pose is not None
    if key.stream_pose.stream != last.stream_pose.stream:
        return True
    T = _between(key, last)
    return bool(rotation_angle(T[:3, :3]) > config.turn or np.linalg.norm(T[:3, 3]) > config.shift)


def _wrong(then: Frame, now: Frame, T_now_then: Array, config: TrackConfig) -> float:
    """Share of what an earlier frame saw at its objects, and just around them, in whose place this
    one sees another colour, or nothing before what lies behind: a table looks the same wherever the
    camera slides along it."""
    about = then.segmap != BACKGROUND
    mask = then.valid & (dilated(about, config.carry.opening) if about.any() else True)
    points = transform_points(T_now_then, then.points[mask].astype(np.float64))
    gap = depth_behind(points, now)
    pixel, _ = pixel_numbers(points, now)
    known = np.isfinite(gap)
    if not known.any():
        return 1.0
    near = config.carry.gap * noisier(points[:, 2])
    colour = np.abs(now.rgb.reshape(-1, 3)[pixel].astype(np.int16) - then.rgb[mask]).mean(axis=-1)
    other = (gap > near) | ((np.abs(gap) <= near) & (colour > config.colour))
    return float(other[known].mean())
