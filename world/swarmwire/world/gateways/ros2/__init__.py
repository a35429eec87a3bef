"""The gateway of ROS 2: emulated robots that answer as bases behind a bridge and behind rmw_zenoh."""

from swarmwire.world.gateways.ros2.gateway import Ros2Gateway
from swarmwire.world.gateways.ros2.publishers import Ros2GatewayOptions

__all__ = ["Ros2Gateway", "Ros2GatewayOptions"]
