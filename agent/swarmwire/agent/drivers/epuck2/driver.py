"""The driver of an e-puck2 over Wi-Fi: one exchange per reading, and one packet per command.

`sense` requests a reading and waits for it; `act` sends at once and requests nothing. Readings are therefore as new as
the network allows, independent of the agent's rate. The robot has no watchdog: when the connection is lost, it keeps
executing its last command.
"""

from collections import Counter
from dataclasses import dataclass, replace
from math import isfinite, radians
from threading import Lock
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.drivers.driver import STOP, Command, Driver, DriverLost
from swarmwire.agent.drivers.epuck2.link import RobotLink, host_and_port
from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.clock import DatedClock, to_ns, to_s
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.epuck2.packets import (
    READABLE_SENSORS,
    SENSORS,
    PacketRequest,
    RobotCommand,
    RobotSettingsBits,
    check_fits,
    wheel_steps,
)
from swarmwire.comms.protocols.epuck2.readings import (
    CHIPS,
    GROUND_BLACK,
    GROUND_WHITE,
    Calibration,
    Compass,
    Epuck2Readings,
    Odometer,
)
from swarmwire.comms.robot.bodies.body import Body

CALIBRATION_S = 5.0  # the robot is silent for a second or two while it calibrates


@dataclass(frozen=True)
class Epuck2Options:
    """Timeouts, and the calibration of one robot."""

    calibrate: bool = parameter(False, help="calibrate the proximity sensors at the start, with nothing near the robot")
    north_deg: float | None = parameter(
        None,
        help="heading of magnetic north in the arena, counter-clockwise from its +x; default: no compass",
        unit="deg",
        at_least=-360,
        at_most=360,
    )
    magnetometer: str = parameter(CHIPS[0], help="the robot's chip; robots from 2025 on have the second", choices=CHIPS)
    offset_x_ut: float = parameter(0.0, help="middle of the magnetometer's x readings over a full turn", unit="uT")
    offset_y_ut: float = parameter(0.0, help="middle of the magnetometer's y readings over a full turn", unit="uT")
    turn_offset_radps: float = parameter(0.0, help="the gyro's reading at rest", unit="rad/s")
    ground_black: float = parameter(GROUND_BLACK, help="the ground sensors' reading on black")
    ground_white: float = parameter(GROUND_WHITE, help="the ground sensors' reading on white")
    connect_s: float = parameter(3.0, help="timeout of the connection and of the first answer", unit="s", above=0)
    answer_s: float = parameter(
        0.1, help="longest wait for a new reading, after which the previous one is used again", unit="s", above=0
    )
    silent_s: float = parameter(1.0, help="silence after which the robot is lost", unit="s", above=0)

    def check(self) -> None:
        """Raise BadInput if two options contradict each other."""
        if self.ground_white <= self.ground_black:
            expected = f"expected more than ground_black, {self.ground_black:g}; got {self.ground_white:g}"
            raise BadInput("driver epuck2", "ground_white", expected)

    @property
    def calibration(self) -> Calibration:
        """The options that convert raw values to readings."""
        compass = Compass(self.magnetometer, radians(self.north_deg or 0.0), self.offset_x_ut, self.offset_y_ut)
        return Calibration(compass, self.turn_offset_radps, self.ground_black, self.ground_white)


class Epuck2Driver(Driver):
    """One e-puck2. The robot has no watchdog: it keeps executing its last command when the connection is lost."""

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
        self._measures = _measured_sensors(body, self._options)
        self._received_ns: int | None = None  # time of the newest reading
        self._newest_sensors: AnyArray = np.zeros(1, SENSORS)
        self._is_reconnected = True  # the next reading is the first of a connection
        self._calibrate = self._options.calibrate
        self._lock = Lock()  # guards link and last command; locked while 21 bytes are sent, which never blocks
        self._link: RobotLink | None = None
        self._last_command = RobotCommand()

    @property
    def target(self) -> str:
        """Host and port of the robot."""
        return f"{self._host}:{self._port}"

    @property
    def measures(self) -> frozenset[str]:
        """Sensors of the body that the robot has; the compass only with `north_deg`."""
        return self._measures

    def open(self) -> None:
        """Connect with the wheels at rest; LEDs keep their last colours, dark at first."""
        self._disconnect()
        options = self._options
        link = RobotLink(self._host, self._port, options.connect_s, self._counts)
        with self._lock:
            self._link, self._last_command = link, replace(self._last_command, left=0, right=0)
        self._counts["connections"] += 1
        self._is_reconnected = True
        if self._calibrate:
            self._exchange(link, options.connect_s + CALIBRATION_S, RobotSettingsBits.CALIBRATE)
            self._calibrate = False
        if not self._exchange(link, options.connect_s):
            hint = "it obeys one program at a time, so end any other one, or switch the robot off"
            raise self._lose(
                DriverLost(f"the e-puck2 at {self.address} takes the connection and does not answer: {hint}")
            )

    def sense(self, sensors: frozenset[str]) -> dict[str, FloatArray]:
        """Request a reading; return the previous one if none arrives within `answer_s`."""
        link = self._connected()
        if not self._exchange(link, self._options.answer_s):
            self._counts["late_answers"] += 1
            silent_s = to_s(self.clock.now_ns() - (self._received_ns or 0))
            if silent_s > self._options.silent_s:
                self._counts["silences"] += 1
                raise self._lose(DriverLost(f"the e-puck2 at {self.address} has been silent for {silent_s:.1f} s"))
        return self._readings.read(self._newest_sensors, sensors)

    def act(self, command: Command) -> None:
        """Send a command; above the wheels' limit both speeds are scaled down by one factor, which keeps the curve."""
        link = self._connected()
        speeds = command.linear_mps, command.angular_radps
        if not all(map(isfinite, speeds)):
            self._counts["not_finite"] += 1
            speeds = 0.0, 0.0
        left, right = wheel_steps(*speeds, self.body.wheels.wheel_base_m)
        try:
            self._send_command(link, left, right, command)
        except DriverLost as lost:
            raise self._lose(lost) from lost

    def stop(self) -> None:
        """Stop the wheels at once."""
        link = self._link
        if link is not None:
            self._send_command(link, 0, 0, STOP)

    def counts(self) -> dict[str, int]:
        """Return the numbers of faults so far, by name."""
        return dict(self._counts)

    def close(self) -> None:
        """Stop the wheels, and disconnect; safe to call more than once."""
        link = self._link
        if link is None:
            return
        try:
            link.drain()  # answers older than the command
            self._send_command(link, 0, 0, STOP)
            # Closing with unread answers resets the connection, which may discard the command.
            self._await_answers(link, self._options.answer_s, reading=False)
        except DriverLost:
            self._counts["not_stopped"] += 1
        self._disconnect()

    def _send_command(self, link: RobotLink, left: int, right: int, command: Command) -> None:
        """Send the wheels' speeds and changed LED colours; may be called from any thread."""
        with self._lock:
            lights = self._last_command.lights
            if command.leds:
                lights = lights.with_changed(command.leds)
            self._last_command = RobotCommand(left, right, lights)
            link.send(self._last_command.encoded())

    def _exchange(
        self, link: RobotLink, timeout_s: float, settings: RobotSettingsBits = RobotSettingsBits.NONE
    ) -> bool:
        """Request a reading and wait for it; return False if it is late, even if earlier ones have arrived."""
        try:
            link.drain()
            self._read_newest(link)
            with self._lock:
                link.send(replace(self._last_command, request=PacketRequest.SENSORS, settings=settings).encoded())
            in_time = self._await_answers(link, timeout_s, reading=True)
        except DriverLost as lost:
            raise self._lose(lost) from lost
        self._read_newest(link)
        return in_time

    def _await_answers(self, link: RobotLink, timeout_s: float, *, reading: bool) -> bool:
        """Return True if all outstanding answers, with `reading` also a reading, arrive in time; else skip them."""
        expected, deadline_ns = link.sent, self.clock.now_ns() + to_ns(timeout_s)
        while link.answered < expected or (reading and link.newest is None):
            remaining_s = to_s(deadline_ns - self.clock.now_ns())
            if remaining_s <= 0.0 or not link.receive(remaining_s):
                link.answered = expected
                return False
        return True

    def _read_newest(self, link: RobotLink) -> None:
        """Store the newest reading, if one has arrived."""
        payload, link.newest = link.newest, None
        if payload is None:
            return
        sensors = np.frombuffer(payload, SENSORS)
        now_ns, steps = self.clock.now_ns(), (int(sensors["steps"][0, 0]), int(sensors["steps"][0, 1]))
        if self._is_reconnected and self._received_ns is not None:
            if not self._odometer.resume(*steps, to_s(now_ns - self._received_ns)):
                self._counts["odometry_began_anew"] += 1
        else:
            self._odometer.update(*steps)
        self._newest_sensors, self._received_ns, self._is_reconnected = sensors, now_ns, False

    def _connected(self) -> RobotLink:
        if self._link is None:
            raise DriverLost(f"the e-puck2 at {self.address} is not connected")
        return self._link

    def _lose(self, lost: DriverLost) -> DriverLost:
        self._disconnect()
        return lost

    def _disconnect(self) -> None:
        with self._lock:
            link, self._link = self._link, None
        if link is not None:
            link.close()


def _measured_sensors(body: Body, options: Epuck2Options) -> frozenset[str]:
    unreadable = frozenset[str]() if options.north_deg is not None else frozenset({"compass"})
    return (READABLE_SENSORS & body.sensors.keys()) - unreadable
