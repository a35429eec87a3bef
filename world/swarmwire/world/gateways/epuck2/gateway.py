"""The gateway of emulated e-puck2s: its options, differences of a body from an e-puck2, and the gateway itself.

The gateway runs a TCP server for each robot, all in one thread.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import radians
from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.clock import DatedClock, to_s
from swarmwire.comms.base.config import parameter
from swarmwire.comms.protocols.epuck2.packets import PAYLOAD_BYTES, READABLE_SENSORS, Header, check_fits
from swarmwire.comms.protocols.epuck2.readings import CHIPS, Compass
from swarmwire.comms.robot.bodies.body import Body, load_body
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.comms.robot.sensors.rays import ProximitySpec
from swarmwire.world.gateways.epuck2.camera import picture
from swarmwire.world.gateways.epuck2.emulated_robot import EmulatedRobot, Epuck2Server, addresses_of
from swarmwire.world.gateways.epuck2.packets import ReceivedCommands, SensorPackets
from swarmwire.world.gateways.gateway import FRESH, ForeignCommands, Gateway
from swarmwire.world.sensors.sensor import Scene

BLACK = bytes(PAYLOAD_BYTES[Header.IMAGE])


@dataclass(frozen=True)
class Epuck2GatewayOptions:
    """The arena's magnetic north, and the robots' magnetometer."""

    north_deg: float = parameter(
        0.0, help="heading of magnetic north in the arena", unit="deg", at_least=-360, at_most=360
    )
    magnetometer: str = parameter(CHIPS[0], help="the robots' chip, which determines its axes", choices=CHIPS)

    @property
    def compass(self) -> Compass:
        """The robots' magnetometer."""
        return Compass(self.magnetometer, radians(self.north_deg))


MAX_ANGLES = 3  # angles in the text of a difference


def differences_of(body: Body) -> tuple[str, ...]:
    """Describe the differences of a body from an e-puck2 that a program for the e-puck2 notices.

    >>> differences_of(load_body("epuck2"))
    ()
    """
    model = load_body("epuck2")
    return (*_sensor_differences(body, model), *_drive_differences(body, model), *_at_rest(body, model))


def _sensor_differences(body: Body, model: Body) -> list[str]:
    pairs = [(name, body.sensors.get(name), model.sensors.get(name)) for name in ("proximity", "light")]
    return [
        f"its {name} looks to {_angles(spec)}, not {_angles(model_value)}"
        for name, spec, model_value in pairs
        if isinstance(spec, ProximitySpec | LightSpec)
        and isinstance(model_value, ProximitySpec | LightSpec)
        and spec.angles_deg != model_value.angles_deg
    ]


def _angles(spec: ProximitySpec | LightSpec) -> str:
    return f"{', '.join(f'{angle:g}' for angle in spec.angles_deg[:MAX_ANGLES])}, ... deg"


def _drive_differences(body: Body, model: Body) -> list[str]:
    base_m, model_base_m = body.wheels.wheel_base_m, model.wheels.wheel_base_m
    fastest, model_value = body.drive.max_linear_mps, model.drive.max_linear_mps
    return [
        *([f"its wheels are {base_m:g} m apart, not {model_base_m:g}"] if base_m != model_base_m else []),
        *([f"it goes up to {fastest:g} m/s, not {model_value:g}"] if fastest != model_value else []),
    ]


def _at_rest(body: Body, model: Body) -> list[str]:
    readable = READABLE_SENSORS - {"odometry"}  # the gateway counts steps instead
    absent = [name for name in model.sensors if name in readable and name not in body.sensors]
    return [f"it has no {', '.join(absent)}, which read as for a robot at rest"] if absent else []


class Epuck2Gateway(Gateway):
    """Emulated e-puck2s, which execute and answer commands as the firmware does, except for refused ones.

    A robot keeps its last command when its connection is lost, since the real one has no watchdog.
    """

    options: ClassVar[type] = Epuck2GatewayOptions
    sensors: ClassVar[frozenset[str]] = READABLE_SENSORS
    unpublished: ClassVar[frozenset[str]] = frozenset({"bumper"})

    def __init__(self, names: Sequence[str], body: Body, address: str, options: Any, clock: DatedClock) -> None:
        super().__init__(names, body, address, options, clock)
        check_fits(body)
        self._options: Epuck2GatewayOptions = options
        self._addresses = addresses_of(address, len(self.names))
        self._counts: Counter[str] = Counter()
        self._received = ReceivedCommands(len(self.names), body, self._counts)
        self._packets = SensorPackets(body, len(self.names), options.compass)
        self._answers = self._packets.answers()
        self._view: tuple[Scene, int] | None = None  # scene of the cameras, and the index of the first robot
        self._pictures: dict[int, bytes] = {}  # pictures of robots whose client requests them
        self._alive = np.ones(len(self.names), bool)
        self._published_ns = 0
        self._server: Epuck2Server | None = None

    def differences(self) -> tuple[str, ...]:
        """See `Gateway.differences`."""
        return (*differences_of(self.body), *super().differences())

    def enter(self, scene: Scene, first: int) -> None:
        """See `Gateway.enter`; without a scene, pictures are black."""
        self._view = scene, first

    def open(self) -> tuple[str, ...]:
        """See `Gateway.open`; a second call returns the same addresses."""
        robots = [self._robot(i) for i in range(len(self.names))]
        self._server = Epuck2Server(robots, self._addresses, self.clock)
        self._server.set_alive(self._alive.tolist())
        self._addresses = self._server.addresses
        return tuple(f"{host}:{port}" for host, port in self._addresses)

    def publish(
        self, time_ns: int, fields: dict[str, FloatArray], alive: BoolArray, ages_ns: Mapping[str, int] = FRESH
    ) -> None:
        """See `Gateway.publish`; odometry is ignored, since an e-puck2 counts the steps of its commands."""
        revived = np.flatnonzero(alive & ~self._alive).tolist()
        steps = self._received.steps_per_s * to_s(time_ns - self._published_ns)
        self._packets.count(steps, self._received.pop_counters() | dict.fromkeys(revived, (0, 0)))
        self._published_ns = time_ns
        self._packets.fill(fields)
        # A single assignment: the other thread sees either the old or the new answers.
        self._answers = self._packets.answers()
        if self._view is not None:
            scene, first = self._view
            self._pictures = {i: picture(scene, first + i) for i in sorted(self._received.watched) if alive[i]}
        if not np.array_equal(alive, self._alive):
            for robot in revived:
                self._received.halt(robot)
            self._alive = alive.copy()
            if self._server is not None:
                self._server.set_alive(alive.tolist())

    def pop_commands(self) -> ForeignCommands:
        """See `Gateway.pop_commands`."""
        return self._received.pop()

    def counts(self) -> dict[str, int]:
        """See `Gateway.counts`."""
        return dict(self._counts)

    def close(self) -> None:
        """See `Gateway.close`."""
        server, self._server = self._server, None
        if server is not None:
            server.close()

    def _robot(self, i: int) -> EmulatedRobot:
        return EmulatedRobot(partial(self._received.add, i), partial(self._part, i), self._counts)

    def _part(self, i: int, header: Header) -> bytes:
        if header is Header.IMAGE:
            return self._pictures.get(i, BLACK)
        return self._answers[i] if header is Header.SENSORS else b""
