"""The e-puck2's driver against its gateway."""

from math import pi
from typing import ClassVar

from swarmwire.agent.drivers.driver import Driver
from swarmwire.agent.drivers.epuck2 import Epuck2Driver
from swarmwire.agent.drivers.epuck2.driver import Epuck2Options
from swarmwire.comms.bodies.body import Body, load_body
from swarmwire.world.gateways.epuck2 import Epuck2Gateway
from swarmwire.world.gateways.epuck2.gateway import Epuck2GatewayOptions
from swarmwire.world.gateways.gateway import Gateway
from tests.support.robots.rig import OwnWireRig

STEP_M = pi * 0.04 / 1000
ROUNDED = 0.5 + 1e-6  # of a step of the wire
G_MPS2 = 9.80665
FASTEST_MPS = 1100 * STEP_M


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
    stream: ClassVar[bool] = False

    def made_body(self) -> Body:
        return load_body("epuck2")

    def made_gateway(self, address: str) -> Gateway:
        options = Epuck2GatewayOptions(stream=self.stream, north_deg=30.0)
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


class StreamingEpuck2Rig(Epuck2Rig):
    """A robot that goes on to answer the last command, as the firmware of the radio module does."""

    stream: ClassVar[bool] = True
