"""The gateway of Crazyflies: programs written with Bitcraze's cflib fly the robots of a group, over `udp://`.

`CrazyflieServer` has a socket for each robot, all in one thread.
"""

import socket
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from selectors import EVENT_READ, DefaultSelector
from threading import Lock, Thread
from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.clock import NS_PER_S, DatedClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.crazyflie import LOGGED_SENSORS, POSITIONED_SENSORS, check_fits
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.world.gateways.crazyflie.flight import STANDSTILL, SupervisorState
from swarmwire.world.gateways.crazyflie.radio import CrazyradioPorts
from swarmwire.world.gateways.crazyflie.robot import EmulatedCrazyflie
from swarmwire.world.gateways.gateway import FRESH, ForeignCommands, Gateway

WHERE = "gateway crazyflie"
MAX_DATAGRAM_BYTES = 64  # longer datagrams are truncated, and still too long
REOPEN_NS = NS_PER_S // 2  # a lost client's port stays closed for 0.5 to 1 s of simulated time
NULL = b"\xff"  # null packet of a scan, which is no client


def addresses_of(address: str, robots: int) -> list[tuple[str, int]]:
    """Return host and port of each robot; BadInput if the address is malformed or has too few ports.

    >>> addresses_of("127.0.0.1:19850", 2), addresses_of("", 1)
    ([('127.0.0.1', 19850), ('127.0.0.1', 19851)], [('127.0.0.1', 0)])
    """
    host, colon, port = (address or "127.0.0.1:0").partition(":")
    first = int(port) if port.isascii() and port.isdigit() else -1
    if not host or not colon or first < 0 or (first and first + robots - 1 > 65535):
        expected = f'expected "host:port" (ports count up, to 65535) or "host:0" (any ports); got {address!r}'
        raise BadInput(WHERE, "address", expected)
    return [(host, first + i if first else 0) for i in range(robots)]


class CrazyflieServer:
    """A thread that answers for all robots of a group until `close`; a robot logs to its newest client.

    Attributes:
        addresses: host and port of each robot.
        lock: locked while a robot answers.
        lost: number of links that `lose` ended.
        alive: (n,) True for robots that answer.
    """

    def __init__(
        self,
        robots: Sequence[EmulatedCrazyflie],
        addresses: Sequence[tuple[str, int]],
        forward: Callable[[int, bytes], None] | None = None,
    ) -> None:
        """BadInput if an address is in use or not permitted.

        `forward` gets the robot and each packet of a client, in place of the robot, which then answers to `answer`.
        """
        self.robots, self._forward = list(robots), forward
        self.lock, self.alive, self.lost = Lock(), [True] * len(robots), 0
        self._sockets = _bound(addresses)
        self.addresses: list[tuple[str, int]] = [bound.getsockname()[:2] for bound in self._sockets]
        self._clients: list[tuple[str, int] | None] = [None] * len(robots)
        self._scanners: dict[int, tuple[str, int]] = {}  # by robot: the newest sender of a null packet
        self._closed: list[int] = []
        self._reopened: list[int] = []
        self._end, self._ended = socket.socketpair()
        self._selector = DefaultSelector()
        for robot, bound in enumerate(self._sockets):
            self._selector.register(bound, EVENT_READ, robot)
        self._selector.register(self._ended, EVENT_READ, None)
        self._thread = Thread(target=self._serve, name="crazyflie gateway", daemon=True)
        self._thread.start()

    def send(self, robot: int, datagram: bytes) -> None:
        """Send to the robot's client, if any; a null packet to the program that scans."""
        to = self._scanners.pop(robot, None) if datagram == NULL else self._clients[robot]
        if to is not None:
            with suppress(OSError):
                self._sockets[robot].sendto(datagram, to)

    def answer(self, robot: int, datagram: bytes) -> bytes | None:
        """Return the robot's answer to a packet; None without one, and if the robot is dead."""
        with self.lock:
            return self.robots[robot].receive(datagram) if self.alive[robot] else None

    def lose(self, robot: int) -> None:
        """Close the robot's port: a client that sends gets an error, as from cflib's driver when a link is lost."""
        is_open = self._sockets[robot].fileno() >= 0  # a packet that is being read may set the client afterwards
        if self._clients[robot] is not None and is_open:
            self._clients[robot], self.lost = None, self.lost + 1
            self._selector.unregister(self._sockets[robot])
            self._sockets[robot].close()
            self._closed.append(robot)

    def reopen(self) -> None:
        """Open the ports that `lose` closed before the last call, except those that other programs have meanwhile."""
        for robot in self._reopened:
            try:
                (self._sockets[robot],) = _bound([self.addresses[robot]])
            except BadInput:
                self._closed.append(robot)
            else:
                self._selector.register(self._sockets[robot], EVENT_READ, robot)
        self._reopened, self._closed = self._closed, []

    def close(self) -> None:
        """Stop to answer, and free the addresses."""
        self._end.close()
        self._thread.join()
        for each in (self._selector, *self._sockets, self._ended):
            each.close()

    def _serve(self) -> None:
        while True:
            for key, _ in self._selector.select():
                if key.data is None:
                    return
                self._answer(key.data)

    def _answer(self, robot: int) -> None:
        with suppress(OSError):
            datagram, client = self._sockets[robot].recvfrom(MAX_DATAGRAM_BYTES)
            if datagram == NULL:
                self._scanners[robot] = client
            else:
                self._clients[robot] = client
            if self._forward is not None:
                self._forward(robot, datagram)
            elif (answer := self.answer(robot, datagram)) is not None:
                self.send(robot, answer)


def _bound(addresses: Sequence[tuple[str, int]]) -> list[socket.socket]:
    """Return a socket for each address; if one fails, all are closed."""
    sockets: list[socket.socket] = []
    for host, port in addresses:
        sockets.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        try:
            sockets[-1].bind((host, port))
        except OSError as error:
            for opened in sockets:
                opened.close()
            expected = f"expected {host}:{port} to be free and permitted: {error.strerror or error}"
            raise BadInput(WHERE, "address", expected) from error
    return sockets


class CrazyflieGateway(Gateway):
    """Emulated Crazyflies. They stand on the floor until a program lets them take off, and log once a tick at most.

    Only the gateway has their height: in the world a robot is always at its body's altitude.
    """

    sensors: ClassVar[frozenset[str]] = LOGGED_SENSORS | POSITIONED_SENSORS

    def __init__(self, names: Sequence[str], body: Body, address: str, options: Any, clock: DatedClock) -> None:
        super().__init__(names, body, address, options, clock)
        check_fits(body)
        self._addresses = addresses_of(address, len(self.names))
        self._counts: Counter[str] = Counter()
        self._robots = [self._new_robot() for _ in self.names]
        self._alive = np.ones(len(self.names), np.bool_)
        self._shown = np.zeros(len(self.names), np.int64)
        self._flew = np.zeros(len(self.names), np.bool_)  # flights in the last tick, whose end is a command, too
        self._motors_on = np.ones(len(self.names), np.bool_)  # state of the motors in the world
        self._server: CrazyflieServer | None = None
        self._radio: CrazyradioPorts | None = None
        self._first = self._reopen_ns = 0

    def join(self, radio: CrazyradioPorts, first: int) -> None:
        """Let all packets cross this radio, from `open` on; `first` is the row of the first robot."""
        self._radio, self._first = radio, first

    def open(self) -> tuple[str, ...]:
        """See `Gateway.open`; the address is cflib's URI."""
        radio, first = self._radio, self._first
        forward = self._forward if radio else None
        server = self._server = CrazyflieServer(self._robots, self._addresses, forward)
        self._addresses = server.addresses
        if radio:
            for i in range(len(self.names)):
                radio.join(first + i, partial(server.answer, i), partial(server.send, i), partial(server.lose, i))
        return tuple(f"udp://{host}:{port}" for host, port in self._addresses)

    def publish(
        self, time_ns: int, fields: dict[str, FloatArray], alive: BoolArray, ages_ns: Mapping[str, int] = FRESH
    ) -> None:
        """See `Gateway.publish`; a revived robot was switched on again."""
        server = self._server
        if server is None:
            return
        with server.lock:
            for i in np.flatnonzero(alive & ~self._alive).tolist():
                self._robots[i] = server.robots[i] = self._new_robot()
                self._flew[i] = self._motors_on[i] = True
            self._alive = alive.copy()
            server.alive = alive.tolist()
            logs = [
                robot.sense(time_ns, {name: column[i] for name, column in fields.items()}) if self._alive[i] else []
                for i, robot in enumerate(self._robots)
            ]
        if time_ns >= self._reopen_ns:
            self._reopen_ns = time_ns + REOPEN_NS
            server.reopen()
        for i, datagrams in enumerate(logs):
            for datagram in datagrams:
                self._radio.send_up(self._first + i, datagram) if self._radio else server.send(i, datagram)

    def pop_commands(self) -> ForeignCommands:
        """See `Gateway.pop_commands`: the speeds of flying robots, and the stop of robots that have landed."""
        server, n = self._server, len(self.names)
        drive, speeds = np.zeros(n, np.bool_), np.zeros((3, n))
        leds: list[tuple[int, int, int]] = []
        motors_on = self._motors_on.copy()
        if server is not None:
            with server.lock:
                for i in np.flatnonzero(self._alive).tolist():
                    robot = self._robots[i]
                    robot.fly()
                    motion = robot.flight.motion
                    flies = robot.flight.state in (SupervisorState.FLYING, SupervisorState.LEVEL_OUT)
                    drive[i] = flies or motion != STANDSTILL or self._flew[i]
                    self._flew[i] = flies
                    motors_on[i] = robot.flight.setpoint.flies
                    speeds[:, i] = motion.forward_mps, motion.turn_radps, motion.left_mps
                    if robot.colour != self._shown[i] and self.body.led_count:
                        self._shown[i] = robot.colour
                        leds.append((i, 0, robot.colour))
        rows, led, colour = np.array(leds, np.int64).reshape(-1, 3).T.copy()
        switched = np.flatnonzero(motors_on != self._motors_on)
        self._motors_on = motors_on
        motors = SparseTable(switched, np.zeros_like(switched), motors_on[switched].astype(float))
        linear_mps, angular_radps, lateral_mps = speeds
        colours = SparseTable(rows, led, colour.astype(float))
        return ForeignCommands(drive, linear_mps, angular_radps, lateral_mps, colours, motors)

    def counts(self) -> dict[str, int]:
        """See `Gateway.counts`."""
        lost = self._server.lost if self._server else 0
        return {**self._counts, **({"links_lost": lost} if lost else {})}

    def close(self) -> None:
        """See `Gateway.close`."""
        server, self._server = self._server, None
        if server is not None:
            server.close()

    def _forward(self, robot: int, datagram: bytes) -> None:
        assert self._radio
        self._radio.send_down(self._first + robot, datagram)

    def _new_robot(self) -> EmulatedCrazyflie:
        return EmulatedCrazyflie(self.body, self._counts)
