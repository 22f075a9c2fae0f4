"""One segmented RGBD frame, checked."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.spoken import counted

BACKGROUND = 0
# Of 255, by which the channels of a grey pixel differ, after compression too.
NO_HUE = 4
ONE_CAMERA = "colour, depth and masks must come from one camera at one resolution"


@dataclass(frozen=True)
class StreamPose:
    """Where a camera was that does not tell it, as a session that tracks found.

    stream : number of a sequence of frames whose cameras are known to one another
    T_stream_cam : (4, 4) rigid, to the frame of the first camera of these
    """

    stream: int
    T_stream_cam: NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Frame:
    """What the camera saw and which pixel belongs to which object.

    Attributes
    ----------
    rgb : (H, W, 3) uint8
    points : (H, W, 3) float32, metres, camera frame (x right, y down, z forward); NaN = no return
    segmap : (H, W) int64, object ids; 0 = background
    K : (3, 3) float64, pinhole intrinsics, pixels
    T_world_cam : (4, 4) float64 or None, camera frame to world frame
    source : the file or folder it came from, for messages
    aside : (H, W) int64, masks that were left out where brrp made those of `segmap`, 0 = none: what
        is recognised mends such masks. None where masks came with the frame
    corrected : ids of those of such masks that somebody corrected: they stay as they are
    stream_pose : in a stream of frames without T_world_cam; None outside of one

    The arrays are read-only copies: nothing downstream can change what the caller handed in.
    """

    rgb: NDArray[np.uint8]
    points: NDArray[np.float32]
    segmap: NDArray[np.int64]
    K: NDArray[np.float64]
    T_world_cam: NDArray[np.float64] | None = None
    source: Path | None = field(default=None, compare=False)
    aside: NDArray[np.int64] | None = field(default=None, compare=False)
    corrected: frozenset[int] = field(default=frozenset(), compare=False)
    stream_pose: StreamPose | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        height, width = self.segmap.shape
        for name, shape in {
            "rgb": (height, width, 3),
            "points": (height, width, 3),
            "K": (3, 3),
            "T_world_cam": (4, 4),
            "aside": (height, width),
        }.items():
            value = getattr(self, name)
            if value is not None and value.shape != shape:
                raise FrameError(
                    f"The frame's {name} has the wrong shape",
                    where=self.source,
                    expected=shape,
                    found=value.shape,
                    fix=ONE_CAMERA,
                )
        for name in ("rgb", "points", "segmap", "K", "T_world_cam", "aside"):
            value = getattr(self, name)
            if value is not None:
                value = value.copy()
                value.setflags(write=False)
                object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """Sizes, without the arrays."""
        height, width = self.shape
        source = "" if self.source is None else f", {self.source}"
        return f"Frame({width} x {height}, {counted(len(self.object_ids), 'object')}{source})"

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W)."""
        height, width = self.segmap.shape
        return height, width

    @cached_property
    def valid(self) -> NDArray[np.bool_]:
        """(H, W) bool: pixels with a depth return."""
        x, y, z = np.isfinite(np.moveaxis(self.points, -1, 0))
        return x & y & z & (self.points[..., 2] > 0)

    @cached_property
    def coloured(self) -> bool:
        """Whether pixels differ in colour: a frame that was made without is of one grey."""
        return bool(self.rgb.min() < self.rgb.max())

    @cached_property
    def hueless(self) -> bool:
        """Whether the image is one of brightness alone, as of a monochrome camera."""
        # Channel by channel: NumPy is slow along so short an axis.
        red, green, blue = (self.rgb[..., channel] for channel in range(3))
        high = np.maximum(np.maximum(red, green), blue)
        low = np.minimum(np.minimum(red, green), blue)
        return bool((high - low).max() <= NO_HUE)

    @cached_property
    def depth(self) -> NDArray[np.float32]:
        """(H, W) metres along z, NaN where there is no return: that of `points`, in one piece of
        memory, for those who look up pixels."""
        depth = np.ascontiguousarray(self.points[..., 2])
        depth.setflags(write=False)
        return depth

    @cached_property
    def object_ids(self) -> list[int]:
        """Ids in the mask, ascending, without the background."""
        return [int(i) for i in np.unique(self.segmap[self.segmap != BACKGROUND])]

    def with_masks(
        self,
        segmap: NDArray[np.integer],
        aside: NDArray[np.integer] | None = None,
        corrected: frozenset[int] = frozenset(),
    ) -> Frame:
        """The same image with other masks (H, W). Unlike `dataclasses.replace` it copies nothing
        but these. Errors: FrameError for another shape."""
        frame = copy(self)
        for name, given in (("segmap", segmap), ("aside", aside)):
            if given is not None and given.shape != self.shape:
                raise FrameError(
                    "The masks have another size than the frame",
                    where=self.source,
                    expected=self.shape,
                    found=given.shape,
                )
            masks = None if given is None else given.astype(np.int64)
            if masks is not None:
                masks.setflags(write=False)
            object.__setattr__(frame, name, masks)
        object.__setattr__(frame, "corrected", corrected)
        vars(frame).pop("object_ids", None)
        return frame

    def without_masks(self) -> Frame:
        """The same image, all of it background."""
        return self.with_masks(np.zeros(self.shape, np.int64))

    def with_points(self, points: NDArray[np.float32]) -> Frame:
        """The same image with other points (H, W, 3), metres, camera frame, at the same pixels.
        Unlike `dataclasses.replace` it copies nothing, and makes the points read-only."""
        points.setflags(write=False)
        frame = copy(self)
        object.__setattr__(frame, "points", points)
        for derived in ("valid", "depth"):
            vars(frame).pop(derived, None)
        return frame

    def object_points(self, object_id: int) -> NDArray[np.float32]:
        """(n, 3) valid points of one object, metres, camera frame."""
        # By number: a mask over three axes is looked up three times as slowly.
        number = np.flatnonzero(self.valid & (self.segmap == object_id))
        return self.points.reshape(-1, 3).take(number, axis=0)
