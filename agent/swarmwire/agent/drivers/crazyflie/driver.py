"""The driver of a Crazyflie: sensors, take-off, flight, landing and stops."""

from collections import Counter
from dataclasses import dataclass, replace
from math import isfinite, nan, radians
from typing import Any, ClassVar

import numpy as np

from swarmwire.agent.drivers.crazyflie.link import CrazyflieLink, Pilot, parse_uri
from swarmwire.agent.drivers.driver import Command, Driver, DriverLost, MotorsOff
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import DatedClock, to_ns
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import CRAZYFLIE
from swarmwire.comms.protocols.crazyflie import (
    ARMED_BIT,
    CRASHED_BIT,
    DIRECTIONS_DEG,
    G_MPS2,
    LOCKED_BIT,
    LOGGED_SENSORS,
    POSITIONED_SENSORS,
    SOLID_COLOUR,
    check_fits,
    from_mm,
    turned,
)
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.sensors.simple import BatterySpec

BLOCKS = (
    (
        "stateEstimate.x",
        "stateEstimate.y",
        "stateEstimate.z",
        "stateEstimate.vx",
        "stateEstimate.vy",
        "stateEstimate.yaw",
    ),
    (*(f"range.{name}" for name in DIRECTIONS_DEG), "pm.vbat", "pm.state", "supervisor.info"),
    ("acc.x", "acc.y", "gyro.z"),
)
ON_FLOOR_M = 0.1
RESET_S = 0.1
MAX_LANDING_S = 5.0  # shorter than the guard's wait for the end of an agent


@dataclass(frozen=True)
class CrazyflieOptions:
    """Positioning, and timeouts."""

    positioned: bool = parameter(
        False, help="a positioning system (Lighthouse, Loco, motion capture) gives the state estimate the arena's frame"
    )
    climb_mps: float = parameter(0.3, help="speed of take-off and landing", unit="m/s", above=0, at_most=1)
    settle_s: float = parameter(2.0, help="wait for the state estimate after its reset", unit="s", at_least=0)
    connect_s: float = parameter(15.0, help="timeout of the connection", unit="s", above=0)
    silent_s: float = parameter(1.0, help="silence after which the robot is lost", unit="s", above=0)


class CrazyflieDriver(Driver):
    """One Crazyflie, by radio or UDP. It takes off with the first command, and hovers at its body's altitude.

    `stop` lets it hover on the spot, and lands it after two seconds without a command; `close` lands it;
    `emergency_stop` switches the motors off in the air, and it must be switched on again. A low battery lands it.
    """

    options: ClassVar[type] = CrazyflieOptions
    body_name: ClassVar[str] = "crazyflie"

    def __init__(self, address: str, body: Body, options: Any, clock: DatedClock) -> None:
        """Check the parameters; BadInput also if cflib is not installed."""
        super().__init__(address, body, options, clock)
        self._uri = parse_uri(address)
        check_fits(body)
        if body.altitude_m > MAX_LANDING_S * options.climb_mps:
            least = f"expected to land within {MAX_LANDING_S:g} s, {body.altitude_m / MAX_LANDING_S:g} m/s"
            raise BadInput("driver crazyflie", "climb_mps", f"{least}; got {options.climb_mps!r}")
        CRAZYFLIE.need("driver crazyflie")
        self._options: CrazyflieOptions = options
        self._counts: Counter[str] = Counter()
        self._link: CrazyflieLink | None = None
        self._pilot: Pilot | None = None

    @property
    def target(self) -> str:
        """Unique text for the robot, the same for each Crazyradio that reaches it."""
        return self._uri.target

    @property
    def device(self) -> str:
        """The Crazyradio, which a process claims; empty without one."""
        return f"Crazyradio {self._uri.radio}" if self._uri.radio else ""

    @property
    def measures(self) -> frozenset[str]:
        """Sensors of the body that the firmware logs; `positioning` and `compass` only with `positioned`."""
        frame = POSITIONED_SENSORS if self._options.positioned else frozenset[str]()
        return (LOGGED_SENSORS | frame) & self.body.sensors.keys()

    def open(self) -> None:
        """Connect; MotorsOff if the robot is locked or crashed. A flying robot keeps hovering."""
        self._disconnect()
        link = CrazyflieLink(self.address, BLOCKS, self._options.connect_s, self.clock)
        self._link = link
        self._counts["connections"] += 1
        height_m = self._first_height(link)
        if height_m < ON_FLOOR_M:
            link.set("kalman.resetEstimation", 1)
            self._wait(RESET_S)
            link.set("kalman.resetEstimation", 0)
            self._wait(self._options.settle_s)
        if self.body.led_count:
            self._show(link, 0)
            link.set("ring.effect", SOLID_COLOUR)
        self._check(link)
        start_m = height_m if height_m >= ON_FLOOR_M else 0.0
        self._pilot = Pilot(link, self.body.altitude_m, self._options.climb_mps, start_m, self.clock)

    def sense(self, sensors: frozenset[str]) -> dict[str, FloatArray]:
        """Return the newest log variables without waiting; nan before the first."""
        link = self._connected()
        fields = self._fields(link.values())
        return {name: value for name, value in fields.items() if name.partition(".")[0] in sensors & self.measures}

    def act(self, command: Command) -> None:
        """Send a command, clipped to the body's limits; the first one takes off."""
        link = self._connected()
        speeds = command.linear_mps, command.lateral_mps, command.angular_radps
        if not all(map(isfinite, speeds)):
            self._counts["not_finite"] += 1
            speeds = 0.0, 0.0, 0.0
        limits = self.body.max_linear_mps, self.body.max_linear_mps, self.body.max_angular_radps
        linear, lateral, angular = (max(-limit, min(limit, v)) for v, limit in zip(speeds, limits, strict=True))
        for colour in command.leds.values():
            self._show(link, colour)
        self._counts["low_battery_commands"] += link.is_low()
        if not link.is_set(ARMED_BIT):
            link.arm()
        if self._pilot is not None:
            self._pilot.command(replace(command, linear_mps=linear, lateral_mps=lateral, angular_radps=angular))

    def stop(self) -> None:
        """Hover on the spot, then land unless a command follows."""
        pilot = self._pilot
        if pilot is not None:
            pilot.hover()

    def emergency_stop(self) -> None:
        """Switch the motors off at once, also in the air; a Crazyflie on the floor is not locked."""
        pilot = self._pilot
        if pilot is not None:
            pilot.emergency_stop()

    def counts(self) -> dict[str, int]:
        """Return the numbers of connections and of faulty or weak-battery commands, by name."""
        return dict(+self._counts)

    def close(self) -> None:
        """Land, then disconnect; safe to call more than once."""
        self._disconnect()

    def _show(self, link: CrazyflieLink, colour: int) -> None:
        for name, shift in (("Red", 16), ("Green", 8), ("Blue", 0)):
            link.set(f"ring.solid{name}", colour >> shift & 0xFF)

    def _disconnect(self, *, lands: bool = True) -> None:
        pilot, link = self._pilot, self._link
        if pilot is not None:
            pilot.end(lands=lands)  # an emergency stop still reaches the pilot meanwhile
        self._pilot = self._link = None
        if link is not None:
            link.close()

    def _connected(self) -> CrazyflieLink:
        link = self._link
        if link is None:
            raise DriverLost(f"the Crazyflie at {self.address} is not connected")
        self._check(link)
        return link

    def _check(self, link: CrazyflieLink) -> None:
        robot = f"the Crazyflie at {self.address}"
        if link.is_set(LOCKED_BIT) or link.is_set(CRASHED_BIT):
            self._disconnect(lands=False)
            raise MotorsOff(f"{robot} is locked or crashed: switch it off and on")
        if link.fault:
            self._disconnect(lands=False)
            raise DriverLost(f"{robot} is lost: {link.fault}")
        silent_s = link.silent_s
        if silent_s > self._options.silent_s:
            self._disconnect()  # the silence may end, and the firmware stops the motors after 2 s
            raise DriverLost(f"{robot} is lost: it has been silent for {silent_s:.1f} s")

    def _first_height(self, link: CrazyflieLink) -> float:
        """Wait for the first log variables, and return the estimated height in m."""
        deadline_ns = self.clock.now_ns() + to_ns(self._options.connect_s)
        while len(link.values()) < sum(map(len, BLOCKS)):
            if self.clock.now_ns() > deadline_ns:
                self._disconnect()
                raise DriverLost(f"the Crazyflie at {self.address} does not log")
            self._wait(0.01)
        return link.values()["stateEstimate.z"]

    def _wait(self, time_s: float) -> None:
        self.clock.sleep_until(self.clock.now_ns() + to_ns(time_s))

    def _fields(self, values: dict[str, float]) -> dict[str, FloatArray]:
        """Return the readings of all sensors from log variables: "sensor.field" -> (1,) or (1, width)."""

        def logged(name: str) -> float:
            return values.get(name, nan)

        yaw = radians(logged("stateEstimate.yaw"))
        forward, left = turned(logged("stateEstimate.vx"), logged("stateEstimate.vy"), -yaw)
        volts = logged("pm.vbat")
        scalars = {
            "flow.forward_mps": forward,
            "flow.left_mps": left,
            "imu.forward_mps2": G_MPS2 * logged("acc.x"),
            "imu.left_mps2": G_MPS2 * logged("acc.y"),
            "imu.turn_radps": radians(logged("gyro.z")),
            "positioning.x_m": logged("stateEstimate.x"),
            "positioning.y_m": logged("stateEstimate.y"),
            "compass.heading_rad": yaw,
            "battery.voltage_v": volts,
        }
        fields = {name: np.array([value]) for name, value in scalars.items()}
        battery = self.body.sensors.get("battery")
        if isinstance(battery, BatterySpec):
            charge = (volts - battery.empty_v) / (battery.full_v - battery.empty_v)
            fields["battery.charge"] = np.clip([charge], 0.0, 1.0)
        ranges_mm = [logged(f"range.{name}") for name in DIRECTIONS_DEG]
        scan, proximity = self.body.scan, self.body.proximity
        if scan is not None:
            fields["scan.range_m"] = from_mm(ranges_mm, scan.range_m)[None, :]
        if proximity is not None:
            rim_distance_m = np.maximum(from_mm(ranges_mm, 1e3) - self.body.radius_m, 0.0)
            is_near = rim_distance_m <= proximity.range_m
            response = proximity.response.value(np.minimum(rim_distance_m, proximity.range_m))
            fields["proximity.value"] = np.where(is_near, response, 0.0)[None, :]
        return fields
