"""What a user may tell the driver of an e-puck2."""

from collections import Counter
from dataclasses import dataclass, replace
from math import isfinite, radians
from threading import Lock
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.drivers.driver import STOP, Command, Driver, DriverLost
from swarmwire.agent.drivers.epuck2.link import RobotLink, host_and_port
from swarmwire.comms.arrays import AnyArray, FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.clock import DatedClock, to_ns, to_s
from swarmwire.comms.config import parameter
from swarmwire.comms.errors import BadInput
from swarmwire.comms.robots.epuck2.commands import READABLE_SENSORS, RobotCommand, check_fits, wheel_steps
from swarmwire.comms.robots.epuck2.packets import SENSORS, PacketRequest, RobotSettingsBits
from swarmwire.comms.robots.epuck2.readings import (
    CHIPS,
    GROUND_BLACK,
    GROUND_WHITE,
    Calibration,
    Compass,
    Epuck2Readings,
    Odometer,
)


@dataclass(frozen=True)
class Epuck2Options:
    """Time-outs, and what is to be known of one robot."""

    calibrate: bool = parameter(
        False, help="have the robot calibrate its proximity sensors at the start: nothing may be near it then"
    )
    north_deg: float | None = parameter(
        None,
        help="heading of magnetic north in the arena, counter-clockwise from its +x; without it there is no compass",
        unit="deg",
        at_least=-360,
        at_most=360,
    )
    magnetometer: str = parameter(CHIPS[0], help="the robot's chip; the second in robots from 2025 on", choices=CHIPS)
    offset_x_ut: float = parameter(
        0.0, help="middle of what the magnetometer's x reads in a full turn of the robot", unit="uT"
    )
    offset_y_ut: float = parameter(0.0, help="the same of its y", unit="uT")
    turn_offset_radps: float = parameter(0.0, help="what the gyro tells of a robot at rest", unit="rad/s")
    ground_black: float = parameter(GROUND_BLACK, help="what the ground sensors tell on black")
    ground_white: float = parameter(GROUND_WHITE, help="what they tell on white")
    connect_s: float = parameter(3.0, help="the robot must take a connection and answer within", unit="s", above=0)
    answer_s: float = parameter(
        0.1, help="wait for a new reading at most; then the one before is told once more", unit="s", above=0
    )
    silent_s: float = parameter(1.0, help="a robot that is silent for longer is lost", unit="s", above=0)

    def check(self) -> None:
        """BadInput if two of these do not go together."""
        if self.ground_white <= self.ground_black:
            expected = f"expected more than ground_black, {self.ground_black:g}; got {self.ground_white:g}"
            raise BadInput("driver epuck2", "ground_white", expected)

    @property
    def calibration(self) -> Calibration:
        """What of these its readings depend on."""
        compass = Compass(self.magnetometer, radians(self.north_deg or 0.0), self.offset_x_ut, self.offset_y_ut)
        return Calibration(compass, self.turn_offset_radps, self.ground_black, self.ground_white)


# --- The driver of an e-puck2: an exchange for each reading, and a command for each decision.


CALIBRATION_S = 5.0  # the robot is silent for a second or two while it calibrates


class Epuck2Driver(Driver):
    """One e-puck2. The robot has no watchdog: it goes on as it was told when the connection is lost.

    A reading is asked for when it is wanted, and waited for; a decision goes out at once, and asks for nothing. So
    readings are as new as the network allows, whatever the rate of the agent.
    """

    options: ClassVar[type] = Epuck2Options
    body_name: ClassVar[str] = "epuck2"

    def __init__(self, address: str, body: Body, options: Any, clock: DatedClock) -> None:
        super().__init__(address, body, options, clock)
        self._host, self._port = host_and_port(address)
        check_fits(body)
        self._options: Epuck2Options = options
        self._options.check()
        self._counts: Counter[str] = Counter()
        self._odometer = Odometer()
        self._readings = Epuck2Readings(body, options.calibration, self._odometer)
        self._gives = _given(body, self._options)
        self._received_ns: int | None = None  # when the newest reading came
        self._told_sensors: AnyArray = np.zeros(1, SENSORS)
        self._anew = True  # the next reading is the first one of a connection
        self._calibrate = self._options.calibrate
        self._lock = Lock()  # of the next two: held to send 21 bytes, which never waits
        self._link: RobotLink | None = None
        self._told = RobotCommand()

    @property
    def target(self) -> str:
        """As `Driver.target`: the port, too, where none is said."""
        return f"{self._host}:{self._port}"

    @property
    def measures(self) -> frozenset[str]:
        """As `Driver.measures`: all that the sheet and the robot have; the compass only if north is known."""
        return self._gives

    def open(self) -> None:
        """As `Driver.open`; LEDs are as they were told last, dark at first."""
        self._hang_up()
        options = self._options
        link = RobotLink(self._host, self._port, options.connect_s, self._counts)
        with self._lock:
            self._link, self._told = link, replace(self._told, left=0, right=0)
        self._counts["connections"] += 1
        self._anew = True
        if self._calibrate:
            self._exchange(link, options.connect_s + CALIBRATION_S, RobotSettingsBits.CALIBRATE)
            self._calibrate = False
        if not self._exchange(link, options.connect_s):
            raise self._lose(DriverLost(f"the e-puck2 at {self.address} takes the connection and does not answer"))

    def sense(self, sensors: frozenset[str]) -> dict[str, FloatArray]:
        """As `Driver.sense`."""
        link = self._connected()
        if not self._exchange(link, self._options.answer_s):
            self._counts["late_answers"] += 1
            silent_s = to_s(self.clock.now_ns() - (self._received_ns or 0))
            if silent_s > self._options.silent_s:
                self._counts["silences"] += 1
                raise self._lose(DriverLost(f"the e-puck2 at {self.address} has been silent for {silent_s:.1f} s"))
        return self._readings.of(self._told_sensors, sensors)

    def act(self, command: Command) -> None:
        """As `Driver.act`; what no wheel can follow is slowed down as a whole, so that its curve stays."""
        link = self._connected()
        speeds = command.linear_mps, command.angular_radps
        if not all(map(isfinite, speeds)):
            self._counts["not_finite"] += 1
            speeds = 0.0, 0.0
        left, right = wheel_steps(*speeds, self.body.wheels.wheel_base_m)
        try:
            self._tell(link, left, right, command)
        except DriverLost as lost:
            raise self._lose(lost) from lost

    def stop(self) -> None:
        """As `Driver.stop`."""
        link = self._link
        if link is not None:
            self._tell(link, 0, 0, STOP)

    def counts(self) -> dict[str, int]:
        """As `Driver.counts`."""
        return dict(self._counts)

    def close(self) -> None:
        """As `Driver.close`."""
        link = self._link
        if link is None:
            return
        try:
            self._tell(link, 0, 0, STOP)
            # To hang up on answers that nobody read resets the connection, and may take the command back.
            self._await(link, self._options.answer_s, reading=False)
        except DriverLost:
            self._counts["not_stopped"] += 1
        self._hang_up()

    def _tell(self, link: RobotLink, left: int, right: int, command: Command) -> None:
        """Send speeds and LEDs, which the robot keeps to; any thread may."""
        with self._lock:
            lights = self._told.lights
            if command.leds:
                lights = lights.with_changed(command.leds)
            self._told = RobotCommand(left, right, lights)
            link.send(self._told.encoded())

    def _exchange(
        self, link: RobotLink, timeout_s: float, settings: RobotSettingsBits = RobotSettingsBits.NONE
    ) -> bool:
        """Ask for a reading and wait for it; false if it did not come in time, though earlier ones may have."""
        try:
            link.drain()
            self._take(link)
            with self._lock:
                link.send(replace(self._told, request=PacketRequest.SENSORS, settings=settings).encoded())
            in_time = self._await(link, timeout_s, reading=True)
        except DriverLost as lost:
            raise self._lose(lost) from lost
        self._take(link)
        return in_time

    def _await(self, link: RobotLink, timeout_s: float, *, reading: bool) -> bool:
        """Whether all that is owed comes in that time, a reading among it if one is; else it is not owed any more."""
        owed, until_ns = link.sent, self.clock.now_ns() + to_ns(timeout_s)
        while link.answered < owed or (reading and link.newest is None):
            left_s = to_s(until_ns - self.clock.now_ns())
            if left_s <= 0.0 or not link.receive(left_s):
                link.answered = owed
                return False
        return True

    def _take(self, link: RobotLink) -> None:
        """The newest reading that came, if one did."""
        payload, link.newest = link.newest, None
        if payload is None:
            return
        told = np.frombuffer(payload, SENSORS)
        now_ns, steps = self.clock.now_ns(), (int(told["steps"][0, 0]), int(told["steps"][0, 1]))
        if self._anew and self._received_ns is not None:
            if not self._odometer.resume(*steps, to_s(now_ns - self._received_ns)):
                self._counts["odometry_began_anew"] += 1
        else:
            self._odometer.read(*steps)
        self._told_sensors, self._received_ns, self._anew = told, now_ns, False

    def _connected(self) -> RobotLink:
        if self._link is None:
            raise DriverLost(f"the e-puck2 at {self.address} is not connected")
        return self._link

    def _lose(self, lost: DriverLost) -> DriverLost:
        self._hang_up()
        return lost

    def _hang_up(self) -> None:
        with self._lock:
            link, self._link = self._link, None
        if link is not None:
            link.close()


def _given(body: Body, options: Epuck2Options) -> frozenset[str]:
    unknown = frozenset[str]() if options.north_deg is not None else frozenset({"compass"})
    return (READABLE_SENSORS & body.sensors.keys()) - unknown
