"""Rigs: an emulated robot, and the driver that talks to it."""

from math import pi
from typing import ClassVar

import numpy as np
from hypothesis import HealthCheck, Phase, settings

from swarmwire.agent.drivers.driver import Driver, DriverLost
from swarmwire.agent.drivers.epuck2 import Epuck2Driver
from swarmwire.agent.drivers.epuck2.driver import Epuck2Options
from swarmwire.agent.drivers.ros2 import Ros2Driver, Ros2Options
from swarmwire.comms.robot.bodies.body import Body, body_from, load_body
from swarmwire.world.gateways.epuck2 import Epuck2Gateway
from swarmwire.world.gateways.epuck2.gateway import Epuck2GatewayOptions
from swarmwire.world.gateways.gateway import Gateway
from swarmwire.world.gateways.ros2 import Ros2Gateway, Ros2GatewayOptions
from tests.support.clocks import until
from tests.support.robots.crazyflie import CrazyflieRig
from tests.support.robots.rig import Fields, OwnWireRig, Rig

STEP_M = pi * 0.04 / 1000
ROUNDED = 0.5 + 1e-6  # of a step of the wire
G_MPS2 = 9.80665
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
ON_ONE_RIG = settings(
    max_examples=60,
    phases=[Phase.explicit, Phase.generate],  # a reading that does not come is waited for: to shrink it takes minutes
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


class Epuck2Rig(OwnWireRig):
    """Over TCP; the wire tells whole numbers of what the robot's converters have."""

    resolution: ClassVar[dict[str, float]] = {
        "proximity.value": ROUNDED / 4095,
        "light.value": ROUNDED / 4000,
        "ground.shade": ROUNDED / 1000,
        "scan.range_m": ROUNDED / 1000,
        "odometry.left_m": ROUNDED * STEP_M,
        "odometry.right_m": ROUNDED * STEP_M,
        "imu.forward_mps2": ROUNDED * G_MPS2 / 800,
        "imu.left_mps2": ROUNDED * G_MPS2 / 800,
        "imu.turn_radps": ROUNDED * (250 * pi / 180) / 32768,
        "compass.heading_rad": 1e-6,
        "battery.charge": ROUNDED / 819.2 / 0.8,
        "battery.voltage_v": ROUNDED / 819.2,
    }
    limits: ClassVar[dict[str, tuple[float, float]]] = {
        "scan.range_m": (0.035, 2.0),  # from the body's centre: the sensor sits at its rim
        "imu.forward_mps2": (-1536 / 800 * G_MPS2, 1536 / 800 * G_MPS2),
        "imu.left_mps2": (-1536 / 800 * G_MPS2, 1536 / 800 * G_MPS2),
        "imu.turn_radps": (-250 * pi / 180, 250 * pi / 180 * 32767 / 32768),
    }
    speed_resolution: ClassVar[tuple[float, float]] = (ROUNDED * STEP_M, 2 * ROUNDED * STEP_M / 0.053)
    counts_steps: ClassVar[bool] = True

    def made_body(self) -> Body:
        return load_body("epuck2")

    def made_gateway(self, address: str) -> Gateway:
        options = Epuck2GatewayOptions(north_deg=30.0)
        return Epuck2Gateway(["a-0", "a-1"], self.body, address, options, self.clock)

    def made_driver(self, address: str) -> Driver:
        options = Epuck2Options(north_deg=30.0, connect_s=self.connect_s, silent_s=self.silent_s)
        return Epuck2Driver(address, self.body, options, self.clock)

    def reopen(self) -> None:
        """The same one at the same ports: the one after a port that is free need not be free, too."""
        assert self.gateway.open()[0] == self.address

    def address_of_link(self) -> tuple[str, int]:
        host, _, port = self.address.partition(":")
        return host, int(port)


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
    at_start: ClassVar[Fields] = AT_START
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
            self.publish(self.at_start)
            try:
                fields = driver.sense(driver.measures)
            except DriverLost:  # one of its topics is late on a machine that is busy
                return False
            return all(np.isfinite(value).all() for value in fields.values())

        until(received)
        self.come_back(self.at_start)
        return driver


class RmwRig(Ros2Rig):
    """A base of rmw_zenoh."""

    transport: ClassVar[str] = "rmw"


class StampedRmwRig(RmwRig):
    """A base of rmw_zenoh that takes TwistStamped."""

    stamped: ClassVar[bool] = True


class Turtlebot4Rig(RmwRig):
    """A TurtleBot 4: its scanner is mounted turned, and its base tells of its bumper and its cliff sensors."""

    resolution: ClassVar[dict[str, float]] = {
        **{name: off for name, off in Ros2Rig.resolution.items() if name.split(".")[0] not in ("light", "compass")},
        "bumper.pressed": 0.0,
        "ground.shade": ROUNDED / 2200,
    }
    at_start: ClassVar[Fields] = {
        **{name: value for name, value in AT_START.items() if name.split(".")[0] not in ("light", "compass")},
        "bumper.pressed": np.zeros(1),
        "ground.shade": np.ones((1, 4)),
        "battery.voltage_v": np.full(1, 16.8),
    }

    def made_body(self) -> Body:
        readings = {"scan": {"rate_hz": 0.0}, "odometry": {"rate_hz": 0.0}}
        return body_from({"like": "turtlebot4", "sensors": readings}, "turtlebot4.toml")


RIGS: dict[str, type[Rig]] = {
    "epuck2": Epuck2Rig,
    "crazyflie": CrazyflieRig,
    "ros2 behind a bridge": Ros2Rig,
    "ros2 by rmw_zenoh": RmwRig,
    "ros2 by rmw_zenoh, stamped": StampedRmwRig,
    "ros2 of a TurtleBot 4": Turtlebot4Rig,
}
