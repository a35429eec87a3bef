"""The gateway of emulated e-puck2s: a TCP server for each, all in one thread."""

from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.robots.epuck2.commands import SENSES, check_fits
from swarmwire.world.gateways.epuck2.addresses import addresses_of
from swarmwire.world.gateways.epuck2.differences import differences_of
from swarmwire.world.gateways.epuck2.emulated_robot import EmulatedRobot
from swarmwire.world.gateways.epuck2.options import Epuck2GatewayOptions
from swarmwire.world.gateways.epuck2.received import Received
from swarmwire.world.gateways.epuck2.sensor_packets import SensorPackets
from swarmwire.world.gateways.epuck2.server import Server
from swarmwire.world.gateways.gateway import Commands, Gateway


class Epuck2Gateway(Gateway):
    """Emulated e-puck2s. Each takes and answers commands as the firmware does, but for what is counted as refused.

    A robot goes on as it was told when its connection is lost, since the real one has no watchdog. Its own obstacle
    avoidance is refused: it goes as it is told. Images are black.
    """

    options: ClassVar[type] = Epuck2GatewayOptions
    senses: ClassVar[frozenset[str]] = SENSES
    unsaid: ClassVar[frozenset[str]] = frozenset({"bumper"})

    def __init__(self, names: Sequence[str], body: Body, address: str, options: Any, clock: DatedClock) -> None:
        super().__init__(names, body, address, options, clock)
        check_fits(body)
        self._options: Epuck2GatewayOptions = options
        self._addresses = addresses_of(address, len(self.names))
        self._counts: Counter[str] = Counter()
        self._received = Received(len(self.names), body, self._counts)
        self._packets = SensorPackets(body, len(self.names), options.compass)
        self._answers = self._packets.answers()
        self._alive = np.ones(len(self.names), bool)
        self._server: Server | None = None

    def differences(self) -> tuple[str, ...]:
        """As `Gateway.differences`."""
        return (*differences_of(self.body), *super().differences())

    def open(self) -> tuple[str, ...]:
        """As `Gateway.open`; opened once more it has the same addresses."""
        robots = [self._robot(i) for i in range(len(self.names))]
        self._server = Server(robots, self._addresses)
        self._server.live(self._alive.tolist())
        self._addresses = self._server.addresses
        return tuple(f"{host}:{port}" for host, port in self._addresses)

    def publish(self, time_ns: int, fields: dict[str, FloatArray], alive: BoolArray) -> None:
        """As `Gateway.publish`."""
        for robot, counters in self._received.counters().items():
            self._packets.count_from(robot, *counters)
        self._packets.fill(fields)
        self._answers = self._packets.answers()  # as a whole, so that the other thread sees these or those before
        server = self._server
        if server is not None:
            if not np.array_equal(alive, self._alive):
                for robot in np.flatnonzero(alive & ~self._alive).tolist():
                    self._received.halt(robot)
                self._alive = alive.copy()
                server.live(alive.tolist())
            if self._options.stream:
                server.tell_unasked()

    def take(self) -> Commands:
        """As `Gateway.take`."""
        return self._received.taken()

    def counts(self) -> dict[str, int]:
        """As `Gateway.counts`."""
        return dict(self._counts)

    def close(self) -> None:
        """As `Gateway.close`."""
        server, self._server = self._server, None
        if server is not None:
            server.close()

    def _robot(self, i: int) -> EmulatedRobot:
        return EmulatedRobot(partial(self._received.add, i), lambda: self._answers[i], self._counts)
