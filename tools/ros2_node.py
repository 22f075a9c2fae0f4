"""A ROS 2 node: RGBD in, the mesh of every object out, as markers for RViz.

    source /opt/ros/humble/setup.bash
    python tools/ros2_node.py --ros-args -p prior:=/path/to/prior -p prompt:="small object" \
        -r color:=/camera/color/image_raw \
        -r depth:=/camera/aligned_depth_to_color/image_raw \
        -r camera_info:=/camera/color/camera_info

Prior, retrieval and the models of the prompt are loaded once. The frames are one stream: objects
keep their ids, and what is at rest is not done again (`-p track:=false` takes each frame for
itself). A frame in which something is new takes seconds: while one is at work, newer ones are
dropped but for the last. Topic `objects`: visualization_msgs/MarkerArray,
triangles in the objects' colours, metres, in the frame of the colour image's header. Without a
prompt, masks are made of what stands on the table.

All that it does is in `brrp_cli.ros`, which is tested with the types of ROS's messages. The node
around it needs rclpy, which comes with ROS and not from PyPI, so that we have not run it.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

from brrp_cli import Reconstructor
from brrp_cli.ros import Newest, SeenObject, answer


def run_node() -> None:
    """Start the node and stay until it is stopped."""
    import rclpy
    from geometry_msgs.msg import Point
    from message_filters import ApproximateTimeSynchronizer, Subscriber
    from sensor_msgs.msg import CameraInfo, Image
    from std_msgs.msg import ColorRGBA
    from visualization_msgs.msg import Marker, MarkerArray

    rclpy.init(args=sys.argv)
    node = rclpy.create_node("brrp")
    given = {name: node.declare_parameter(name, "").value for name in ("prior", "prompt")}
    track = bool(node.declare_parameter("track", True).value)
    session = Reconstructor(given["prior"] or None, prompt=given["prompt"] or None, track=track)
    output = node.create_publisher(MarkerArray, "objects", 1)

    def publish(objects: list[SeenObject], messages: tuple[Any, ...]) -> None:
        markers = [Marker(header=messages[0].header, action=Marker.DELETEALL)]
        for each in objects:
            corners, colours = (array.tolist() for array in each.triangle_list())
            marker = Marker(header=messages[0].header, ns="brrp", id=each.object_id)
            marker.type, marker.pose.orientation.w = Marker.TRIANGLE_LIST, 1.0
            marker.scale.x = marker.scale.y = marker.scale.z = 1.0
            marker.points = [Point(x=x, y=y, z=z) for x, y, z in corners]
            marker.colors = [ColorRGBA(r=r, g=g, b=b, a=1.0) for r, g, b in colours]
            markers.append(marker)
        output.publish(MarkerArray(markers=markers))

    newest = Newest(partial(answer, session), publish, node.get_logger().warning)
    topics = {"color": Image, "depth": Image, "camera_info": CameraInfo}
    inputs = [Subscriber(node, kind, topic) for topic, kind in topics.items()]
    ApproximateTimeSynchronizer(inputs, queue_size=5, slop=0.05).registerCallback(newest.put)
    rclpy.spin(node)


if __name__ == "__main__":
    run_node()
