"""The driver of ROS 2 against its gateway, by each way that leads to a base."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.drivers.driver import Driver, DriverLost
from swarmwire.agent.drivers.ros2 import Ros2Driver, Ros2Options
from swarmwire.comms.bodies.body import Body, body_from
from swarmwire.world.gateways.gateway import Gateway
from swarmwire.world.gateways.ros2 import Ros2Gateway, Ros2GatewayOptions
from tests.support.robots.rig import Fields, Rig
from tests.support.waiting import until

SINGLE, DOUBLE = 1e-6, 1e-9  # what is lost on the way of float32, and of formulas
AT_START: Fields = {
    "scan.range_m": np.full((1, 360), 1.0),
    "odometry.left_m": np.zeros(1),
    "odometry.right_m": np.zeros(1),
    "imu.forward_mps2": np.zeros(1),
    "imu.left_mps2": np.zeros(1),
    "imu.turn_radps": np.zeros(1),
    "compass.heading_rad": np.zeros(1),
    "battery.charge": np.ones(1),
    "battery.voltage_v": np.full(1, 12.6),
    "light.value": np.zeros((1, 2)),
}


class Ros2Rig(Rig):
    """A TurtleBot with two photocells whose scanner has a new reading in each tick, behind a bridge.

    A base tells all the time, so the driver has received of each sense once it is connected.
    """

    resolution: ClassVar[dict[str, float]] = {
        "scan.range_m": SINGLE,
        "light.value": DOUBLE,
        "odometry.left_m": DOUBLE,
        "odometry.right_m": DOUBLE,
        "imu.forward_mps2": DOUBLE,
        "imu.left_mps2": DOUBLE,
        "imu.turn_radps": DOUBLE,
        "compass.heading_rad": DOUBLE,
        "battery.charge": SINGLE,
        "battery.voltage_v": SINGLE,
    }
    speed_resolution: ClassVar[tuple[float, float]] = (0.0, 0.0)
    farthest_m: ClassVar[float] = 0.1  # a pose that moves further in a tick is no travel of wheels
    transport: ClassVar[str] = "bridge"
    stamped: ClassVar[bool] = False

    def made_body(self) -> Body:
        readings = {"scan": {"rate_hz": 0.0}, "light": {"angles_deg": [0, 180]}}
        return body_from({"like": "turtlebot3-burger", "sensors": readings}, "turtlebot.toml")

    def made_gateway(self, address: str) -> Gateway:
        options = Ros2GatewayOptions(stamped=self.stamped, north_deg=30.0)
        return Ros2Gateway(["a-0", "a-1"], self.body, address, options, self.clock)

    def made_driver(self, address: str) -> Driver:
        options = Ros2Options(
            transport=self.transport,
            stamped=self.stamped,
            north_deg=30.0,
            stale_s=self.silent_s,
            connect_s=self.connect_s,
        )
        driver = Ros2Driver(address, self.body, options, self.clock)
        driver.robot = "a-0"
        return driver

    def connect(self, address: str = "") -> Driver:
        """As `Rig.connect`, and wait until the driver has received of each sense."""
        driver = super().connect(address)

        def received() -> bool:
            self.publish(AT_START)
            try:
                fields = driver.sense(driver.measures)
            except DriverLost:  # one of its topics is late on a machine that is busy
                return False
            return all(np.isfinite(value).all() for value in fields.values())

        until(received)
        self.come_back(AT_START)
        return driver


class RmwRig(Ros2Rig):
    """A base of rmw_zenoh."""

    transport: ClassVar[str] = "rmw"


class StampedRmwRig(RmwRig):
    """A base of rmw_zenoh that takes TwistStamped."""

    stamped: ClassVar[bool] = True
