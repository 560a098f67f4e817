#!/usr/bin/env python3
"""A ROS 1 node: depth for pairs of pictures of a stereo endoscope.

    rosrun or python3 ros1/endosdk_node.py _calibration:=rig.json _model:=fast

It reads /stereo/left/image_raw and /stereo/right/image_raw, which may be remapped, and publishes /stereo/depth,
/stereo/disparity, /stereo/points, /stereo/result and both camera_info of the rig. Pairs belong together by their time
stamps. Only the newest pair waits while one is computed.
"""

import message_filters
import rospy
from sensor_msgs.msg import Image

from endosdk.errors import EndoError
from endosdk.live.ros_node import INPUTS, MOST_APART_S, OUTPUTS, DepthNode, class_of, for_host, opened


def main() -> None:
    """Serve until ROS shuts down."""
    rospy.init_node("endosdk")
    estimator = opened(rospy.get_param("~model", "fast"), rospy.get_param("~calibration", ""))
    node = DepthNode(estimator, ros1=True)
    publishers = {topic: rospy.Publisher(topic, class_of(kind), queue_size=1) for topic, kind in OUTPUTS.items()}

    def answer(left: Image, right: Image) -> None:
        try:
            answers = node.answer(left, right)
        except EndoError as error:
            rospy.logerr_throttle(5, str(error))
            return
        for topic, message in for_host(answers):
            publishers[topic].publish(message)

    pictures = [message_filters.Subscriber(topic, Image, queue_size=1, buff_size=2**25) for topic in INPUTS]
    message_filters.ApproximateTimeSynchronizer(pictures, 2, MOST_APART_S).registerCallback(answer)
    rospy.loginfo("endosdk: %s is ready", estimator.model.name)
    rospy.spin()


if __name__ == "__main__":
    main()
