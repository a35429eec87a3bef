"""A ROS 2 node that counts together with those of other robots, over the emulated radio.

Once a second it adds 1 to the greatest count that it knows, and broadcasts it. docs/ros2-radio.md says how to run it.
With ROS 2 sourced, one node for each robot:

    python3 count_over_radio.py --ros-args -r __ns:=/tb_0
"""

import struct

import rclpy
from rclpy.node import Node
from std_msgs.msg import UInt8MultiArray

PERIOD_S = 1.0
COUNT = struct.Struct("<BI")  # a kind of message, and the count
KIND = 1


class CountOverRadio(Node):
    def __init__(self) -> None:
        super().__init__("count_over_radio")
        self.count = 0
        self.radio = self.create_publisher(UInt8MultiArray, "radio/tx", 10)
        self.create_subscription(UInt8MultiArray, "radio/rx", self.on_packet, 10)
        self.create_timer(PERIOD_S, self.on_timer)

    def on_packet(self, packet: UInt8MultiArray) -> None:
        """Take the sender's count; the labels of the dimensions are the sender and what the radio measured."""
        sender, *measured = (dimension.label for dimension in packet.layout.dim)
        _, count = COUNT.unpack(bytes(packet.data))
        self.count = max(self.count, count)
        self.get_logger().info(f"{count} from {sender} {' '.join(measured)}")

    def on_timer(self) -> None:
        """Count, and tell all robots within reach."""
        self.count += 1
        self.radio.publish(UInt8MultiArray(data=COUNT.pack(KIND, self.count)))


def main() -> None:
    rclpy.init()
    node = CountOverRadio()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
