"""A ROS 2 node: depth for pairs of pictures of a stereo endoscope.

    ros2 run endosdk_ros2 node --ros-args -p calibration:=rig.json -p model:=fast

It reads /stereo/left/image_raw and /stereo/right/image_raw, which may be remapped, and publishes /stereo/depth,
/stereo/disparity, /stereo/points, /stereo/result and both camera_info of the rig. Pairs belong together by their time
stamps. Only the newest pair waits while one is computed.
"""

import message_filters
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image

from endosdk.errors import EndoError
from endosdk.live.ros_node import INPUTS, MOST_APART_S, OUTPUTS, DepthNode, class_of, for_host, opened

# Cameras publish by best effort. Of more than one picture of a view the older ones would wait, and be answered late.
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class EndoNode(Node):
    """Subscribes to both views and publishes what `DepthNode` answers."""

    def __init__(self) -> None:
        super().__init__("endosdk")
        model = self.declare_parameter("model", "fast").value
        rig = self.declare_parameter("calibration", "").value
        self._node = DepthNode(opened(model, rig), ros1=False)
        self._outputs = {topic: self.create_publisher(class_of(kind), topic, 1) for topic, kind in OUTPUTS.items()}
        pictures = [message_filters.Subscriber(self, Image, topic, qos_profile=NEWEST) for topic in INPUTS]
        self._pairs = message_filters.ApproximateTimeSynchronizer(pictures, 2, MOST_APART_S)
        self._pairs.registerCallback(self._answer)
        self.get_logger().info(f"endosdk: {model} is ready")

    def _answer(self, left: Image, right: Image) -> None:
        try:
            answers = self._node.answer(left, right)
        except EndoError as error:
            self.get_logger().error(str(error), throttle_duration_sec=5.0)
            return
        for topic, message in for_host(answers):
            self._outputs[topic].publish(message)


def main() -> None:
    """Serve until ROS shuts down."""
    rclpy.init()
    try:
        rclpy.spin(EndoNode())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # asked to stop, after which ROS may have shut down already
    finally:
        rclpy.try_shutdown()
