# %% [markdown]
# # A node of ROS 2 that publishes a sonar
#
# A vehicle, or its simulator, publishes its odometry. This node sends a ping from every pose, and publishes what the
# sonar receives, as drivers of real sonars do: images, counts, labels, and where the sonar is mounted. It needs ROS 2
# (rclpy, `marine_acoustic_msgs`) and `pip install "mitsonar[ros]"` in the Python of ROS.
#
# mitsonar makes the bytes of a message itself, and a publisher of rclpy takes bytes in place of a message.

# %%
import rclpy
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosidl_runtime_py.utilities import get_message

import mitsonar
from mitsonar.io import bag

STILL = ("/tf_static", "/sonar/about")                     # sent once, and kept for nodes that come later
SENT = (*STILL, "/sonar/image", "/sonar/recorded", "/sonar/labels")    # the vehicle publishes its poses itself

rclpy.init()
node, publishers, start = rclpy.create_node("sonar"), {}, []
sonar = mitsonar.Sonar("forward_looking", seed=1, elements=16, beams=31, range=16)


def ping(odometry):
    """Send a ping from a pose of the vehicle, and publish it."""
    start.append(odometry.header.stamp.sec)
    pose = bag.pose_of(odometry, start[0])                 # the frame of the odometry is the scene's
    for message in bag.messages(sonar.ping(**pose), start=start[0], still=sonar.pings == 1):
        if message.topic in SENT:
            if message.topic not in publishers:
                quality = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL if message.topic in STILL
                                     else DurabilityPolicy.VOLATILE)
                publishers[message.topic] = node.create_publisher(get_message(message.type), message.topic, quality)
            publishers[message.topic].publish(bag.serialised(message))


node.create_subscription(Odometry, "/odometry", ping, 1)
rclpy.spin(node)
