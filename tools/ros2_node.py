"""An example of a ROS 2 node: RGBD in, meshes of every object out, as markers for RViz.

    source /opt/ros/humble/setup.bash
    python tools/ros2_node.py --ros-args -p prior:=/path/to/prior -p prompt:="small object" \
        -r color:=/camera/color/image_raw \
        -r depth:=/camera/aligned_depth_to_color/image_raw \
        -r camera_info:=/camera/color/camera_info

The prior, retrieval and the models of the prompt are loaded once. A frame takes seconds: while one
is at work newer ones are dropped but for the last. Results are in metres, in the frame of the
colour image's header. Topic `objects`: visualization_msgs/MarkerArray, triangles coloured by
uncertainty; without a prompt, masks are made of what stands on the table.

This needs rclpy, which comes with ROS and not from PyPI; nothing is imported of it until the node
is started. We could run all of this but the node itself: tests drive `answer` with messages that
have ROS's fields.
"""

from __future__ import annotations

import sys
import threading
from typing import Any

import numpy as np

from brrp_cli import Reconstructor
from brrp_cli.errors import BrrpError
from brrp_cli.frames.ros_images import frame_of
from brrp_cli.reconstruction import Reconstruction

Triangles = tuple[np.ndarray, np.ndarray]


def answer(reconstructor: Any, color: Any, depth: Any, info: Any) -> Reconstruction:
    """The objects of one set of messages. Errors: BrrpError."""
    result: Reconstruction = reconstructor(frame_of(color, depth, info))
    return result


def triangles_of(surface: Any) -> Triangles:
    """Corners (3 n, 3), metres, and their colours (3 n, 3), 0 to 1, as a TRIANGLE_LIST has them."""
    mesh = surface.as_trimesh()
    corners = np.asarray(mesh.faces).reshape(-1)
    colours = np.asarray(mesh.visual.vertex_colors)[:, :3] / 255.0
    return np.asarray(mesh.vertices)[corners], colours[corners]


def run_node() -> None:
    """Start the node and stay until it is stopped."""
    import rclpy
    from geometry_msgs.msg import Point
    from message_filters import ApproximateTimeSynchronizer, Subscriber
    from rclpy.node import Node
    from sensor_msgs.msg import CameraInfo, Image
    from std_msgs.msg import ColorRGBA
    from visualization_msgs.msg import Marker, MarkerArray

    class BrrpNode(Node):  # type: ignore[misc]
        """Keeps the last set of messages and works on one at a time."""

        def __init__(self) -> None:
            super().__init__("brrp")
            value = {
                name: self.declare_parameter(name, default).value
                for name, default in {"prior": "", "prompt": "", "method": "brrp"}.items()
            }
            self._reconstructor = Reconstructor(
                value["prior"] or None, method=value["method"], prompt=value["prompt"] or None
            )
            self._waiting: tuple[Any, Any, Any] | None = None
            self._news = threading.Condition()
            self._output = self.create_publisher(MarkerArray, "objects", 1)
            inputs = [
                Subscriber(self, kind, topic)
                for kind, topic in ((Image, "color"), (Image, "depth"), (CameraInfo, "camera_info"))
            ]
            self._inputs = ApproximateTimeSynchronizer(inputs, queue_size=5, slop=0.05)
            self._inputs.registerCallback(self._keep)
            threading.Thread(target=self._work, daemon=True).start()

        def _keep(self, color: Any, depth: Any, info: Any) -> None:
            with self._news:
                self._waiting = (color, depth, info)
                self._news.notify()

        def _work(self) -> None:
            while True:
                with self._news:
                    self._news.wait_for(lambda: self._waiting is not None)
                    messages, self._waiting = self._waiting, None
                assert messages is not None
                try:
                    result = answer(self._reconstructor, *messages)
                except BrrpError as error:
                    self.get_logger().warning(str(error))
                    continue
                self._output.publish(self._markers(result, messages[0].header))
                self.get_logger().info(f"{len(result.reconstructed)} objects")

        def _markers(self, result: Reconstruction, header: Any) -> Any:
            markers = MarkerArray(markers=[Marker(header=header, action=Marker.DELETEALL)])
            for item in result.reconstructed:
                corners, colours = triangles_of(item.surface)
                marker = Marker(header=header, ns="brrp", id=item.object_id)
                marker.type, marker.action = Marker.TRIANGLE_LIST, Marker.ADD
                marker.pose.orientation.w = 1.0
                marker.scale.x = marker.scale.y = marker.scale.z = 1.0
                marker.points = [Point(x=x, y=y, z=z) for x, y, z in corners.tolist()]
                marker.colors = [ColorRGBA(r=r, g=g, b=b, a=1.0) for r, g, b in colours.tolist()]
                markers.markers.append(marker)
            return markers

    rclpy.init(args=sys.argv)
    node = BrrpNode()
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    run_node()
