"""The gateway of Crazyflies: programs written with Bitcraze's cflib fly the robots of a group, over `udp://`."""

from collections import Counter
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.robots.crazyflie import OWN_SENSORS, POSITIONED_SENSORS, check_fits
from swarmwire.comms.tick_io import SparseTable
from swarmwire.world.gateways.crazyflie.flight import REST, State
from swarmwire.world.gateways.crazyflie.robot import EmulatedCrazyflie
from swarmwire.world.gateways.crazyflie.server import Server, addresses_of
from swarmwire.world.gateways.gateway import Commands, Gateway


class CrazyflieGateway(Gateway):
    """Emulated Crazyflies. They stand on the floor until a program lets them take off, and log at each tick at most.

    The height is the gateway's: in the world a robot is always at its body's altitude.
    """

    sensors: ClassVar[frozenset[str]] = OWN_SENSORS | POSITIONED_SENSORS

    def __init__(self, names: Sequence[str], body: Body, address: str, options: Any, clock: DatedClock) -> None:
        super().__init__(names, body, address, options, clock)
        check_fits(body)
        self._addresses = addresses_of(address, len(self.names))
        self._counts: Counter[str] = Counter()
        self._robots = [self._made() for _ in self.names]
        self._alive = np.ones(len(self.names), np.bool_)
        self._shown = np.zeros(len(self.names), np.int64)
        self._flew = np.zeros(len(self.names), np.bool_)  # in the last tick: its end is a command, too
        self._server: Server | None = None

    def open(self) -> tuple[str, ...]:
        """As `Gateway.open`; the address is cflib's URI."""
        self._server = Server(self._robots, self._addresses)
        self._addresses = self._server.addresses
        return tuple(f"udp://{host}:{port}" for host, port in self._addresses)

    def publish(self, time_ns: int, fields: dict[str, FloatArray], alive: BoolArray) -> None:
        """As `Gateway.publish`; a robot that is revived was switched on again."""
        server = self._server
        if server is None:
            return
        with server.lock:
            for i in np.flatnonzero(alive & ~self._alive).tolist():
                self._robots[i] = server.robots[i] = self._made()
                self._flew[i] = True
            self._alive = alive.copy()
            server.alive = alive.tolist()
            told = [
                robot.sense(time_ns, {name: column[i] for name, column in fields.items()}) if self._alive[i] else []
                for i, robot in enumerate(self._robots)
            ]
        for i, datagrams in enumerate(told):
            server.send(i, datagrams)

    def take(self) -> Commands:
        """As `Gateway.take`: the speeds of all that fly, and the stop of those that did."""
        server, n = self._server, len(self.names)
        drive, speeds = np.zeros(n, np.bool_), np.zeros((3, n))
        leds: list[tuple[int, int, int]] = []
        if server is not None:
            with server.lock:
                for i in np.flatnonzero(self._alive).tolist():
                    robot = self._robots[i]
                    robot.fly()
                    motion = robot.flight.motion
                    flies = robot.flight.state in (State.FLYING, State.LEVEL_OUT)
                    drive[i] = flies or motion != REST or self._flew[i]
                    self._flew[i] = flies
                    speeds[:, i] = motion.forward_mps, motion.turn_radps, motion.left_mps
                    if robot.colour != self._shown[i] and self.body.led_count:
                        self._shown[i] = robot.colour
                        leds.append((i, 0, robot.colour))
        rows, place, colour = np.array(leds, np.int64).reshape(-1, 3).T.copy()
        linear_mps, angular_radps, lateral_mps = speeds
        return Commands(drive, linear_mps, angular_radps, lateral_mps, SparseTable(rows, place, colour.astype(float)))

    def counts(self) -> dict[str, int]:
        """As `Gateway.counts`."""
        return dict(self._counts)

    def close(self) -> None:
        """As `Gateway.close`."""
        server, self._server = self._server, None
        if server is not None:
            server.close()

    def _made(self) -> EmulatedCrazyflie:
        return EmulatedCrazyflie(self.body, self._counts)
