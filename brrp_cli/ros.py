"""Between ROS and a session, without ROS: messages in, arrays out. `tools/ros2_node.py` is the
node around it.

Messages are taken by their fields, so that those of rclpy, rospy and rosbags will do.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import BrrpError, unexpected
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.ros_images import frame_of
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.surface.painting import surface_colours

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SeenObject:
    """One object as arrays, in the camera's frame (x right, y down, z forward), metres.

    name : of the stored object that it was taken for; "" where it was taken for none
    vertices : (n, 3) float32; faces : (m, 3) int32; colours : (n, 3) uint8
    uncertainty : (n,) float32, in `uncertainty_unit`
    T_cam_mesh, size_factor : of a recognised object's mesh file, as in `Retrieved`; else None
    """

    object_id: int
    name: str
    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    colours: NDArray[np.uint8]
    uncertainty: NDArray[np.float32]
    uncertainty_unit: str
    T_cam_mesh: NDArray[np.float64] | None
    size_factor: float | None

    def triangle_list(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Corners (3 m, 3), metres, and their colours (3 m, 3), 0 to 1: RViz's TRIANGLE_LIST."""
        corners = self.faces.reshape(-1)
        return self.vertices[corners], self.colours[corners].astype(np.float32) / np.float32(255)


def answer(
    session: Callable[[Frame], Reconstruction], color: Any, depth: Any, camera_info: Any
) -> list[SeenObject]:
    """The objects of one set of messages that have a surface, by id.

    session : a `Reconstructor`; color, depth : Image or CompressedImage, aligned; camera_info :
    CameraInfo of the colour camera

    Errors: BrrpError; FrameError for messages that make no frame.
    """
    result = session(frame_of(color, depth, camera_info))
    return [_seen(item, result.frame) for item in result.reconstructed]


def _seen(item: ObjectReconstruction, frame: Frame) -> SeenObject:
    surface, found = item.surface, item.recognised
    assert surface is not None
    return SeenObject(
        object_id=item.object_id,
        name="" if found is None else found.name,
        vertices=surface.vertices.astype(np.float32),
        faces=surface.faces.astype(np.int32),
        colours=surface_colours(surface, frame, item.object_id),
        uncertainty=surface.uncertainty,
        uncertainty_unit=surface.uncertainty_unit,
        T_cam_mesh=None if found is None else found.T_cam_mesh,
        size_factor=None if found is None else found.size_factor,
    )


class Newest:
    """Works on the newest messages in a thread of its own: what comes while it works replaces what
    waits.

    work : messages -> result; give : (result, messages) -> None; tell : takes the text of an error
    that work raised, which ends nothing
    """

    def __init__(
        self,
        work: Callable[..., Any],
        give: Callable[[Any, tuple[Any, ...]], None],
        tell: Callable[[str], object],
    ) -> None:
        self._work, self._give, self._tell = work, give, tell
        self._waiting: tuple[Any, ...] | None = None
        self._ended = False
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, *messages: Any) -> None:
        """Returns at once, so that it can be the callback of a subscription."""
        with self._news:
            self._waiting = messages
            self._news.notify()

    def close(self) -> None:
        """Wait for what is being worked on, and do no more."""
        with self._news:
            self._ended = True
            self._news.notify()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting is not None or self._ended)
                messages, self._waiting = self._waiting, None
                if self._ended or messages is None:
                    return
            try:
                result = self._work(*messages)
            except BrrpError as error:
                self._tell(str(error))
                continue
            except Exception as error:  # a library stumbled over this one; the next may be well
                log.debug("Newest", exc_info=True)
                self._tell(str(unexpected(error)))
                continue
            self._give(result, messages)
