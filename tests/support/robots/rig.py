"""A rig: a driver opened against its gateway, with readings of the test's choice, and what the gateway was told.

What holds for every driver is tried on all rigs. To add a driver: a subclass of `Rig` that says what of the wire a test
must know (which sensors it has, how finely their readings come back, within which limits), and its line in `RIGS`
of `rigs.py`. Faults of the link are tried on each `OwnWireRig`, whose driver counts `garbage`, `silences`,
`hung_up` and `late_answers`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf, pi
from typing import Any, ClassVar

import numpy as np
from hypothesis import strategies as st

from swarmwire.agent.drivers.driver import Driver, DriverLost
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.comms.robot.sensors.rays import ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.comms.robot.sensors.simple import BatterySpec, GroundSpec
from swarmwire.world.gateways.gateway import Gateway
from tests.support.clocks import until

Fields = dict[str, FloatArray]  # "sensor.field" -> (1,) or (1, width): of the driver's robot

NEIGHBOUR = 1  # the other robot of the gateway's group, whose readings are others
_SHARE = st.floats(0.0, 1.0)
_SPEED, _POSITION = st.floats(-2.0, 2.0), st.floats(-50.0, 50.0)


@dataclass
class Commands:
    """What the driver's robot was told, since somebody looked last."""

    speeds: list[tuple[float, float]] = field(default_factory=list)  # m/s, rad/s to the left
    leds: dict[int, int] = field(default_factory=dict)  # place -> 0xRRGGBB


class Rig(ABC):
    """A gateway of two robots and, once connected, the driver of the first.

    Attributes:
        resolution: by "sensor.field" of all sensors that the driver measures, how far from the published one a
            reading may be.
        limits: by "sensor.field", the least and the greatest that the wire can tell; others have none.
        speed_resolution: the same of commands, in m/s and rad/s.
        counts_steps: whether the robot counts the steps of its commands, whatever odometry is published.
        stands_until_commanded: whether a robot that was never driven is at rest without being told.
        farthest_m: how far a wheel may roll in a tick for the wire to tell it.
        silent_s: drivers that are made call a robot lost that is silent for so long; long, for machines are busy.
        connect_s: drivers that are made wait so long for their robot.
    """

    resolution: ClassVar[dict[str, float]]
    limits: ClassVar[dict[str, tuple[float, float]]] = {}
    speed_resolution: ClassVar[tuple[float, float]]
    counts_steps: ClassVar[bool] = False
    stands_until_commanded: ClassVar[bool] = False
    farthest_m: ClassVar[float] = 3.0

    @classmethod
    def measures(cls) -> set[str]:
        """The sensors that the driver measures."""
        return {name.partition(".")[0] for name in cls.resolution}

    def __init__(self) -> None:
        self.connect_s, self.silent_s = 10.0, 60.0
        self.clock, self.tick = WallClock(), 0
        self.body = self.made_body()
        self.gateway = self.made_gateway("")
        self.address = self.gateway.open()[0]
        self._drivers: list[Driver] = []
        self.driver: Driver

    @abstractmethod
    def made_body(self) -> Body:
        """The body of both robots."""

    @abstractmethod
    def made_gateway(self, address: str) -> Gateway:
        """A gateway of two robots, not yet open; empty: at addresses of its own choice."""

    @abstractmethod
    def made_driver(self, address: str) -> Driver:
        """A driver, not yet open."""

    def reopen(self) -> None:
        """A gateway at the addresses of the one that was closed."""
        self.gateway = self.made_gateway(self.address)
        assert self.gateway.open()[0] == self.address

    def connect(self, address: str = "") -> Driver:
        """Open a driver, of the gateway's first robot unless told otherwise."""
        self.driver = self.made_driver(address or self.address)
        self._drivers.append(self.driver)
        self.driver.open()
        return self.driver

    def publish(self, fields: Fields, *, alive: bool = True) -> None:
        """Readings of the driver's robot; its neighbour reads them upside down."""
        both = {name: np.concatenate([value, -value]) for name, value in fields.items()}
        self.tick += 1
        self.gateway.publish(self.tick * NS_PER_S // 10, both, np.array([alive, True]))

    def come_back(self, fields: Fields) -> Fields:
        """What the driver senses of these readings once they have come; fails if they do not."""
        expected = {name: self.expected(name, value) for name, value in fields.items()}
        readings = frozenset(name.partition(".")[0] for name in fields)
        sensed: Fields = {}

        def came() -> bool:
            self.publish(fields)  # anew, as a world does: a topic may drop one
            try:
                sensed.update(self.driver.sense(readings))
            except DriverLost:  # a machine that is busy holds up both ends, and it is found again by the next
                return False
            return all(self.near(name, sensed[name], value) for name, value in expected.items())

        try:
            until(came)
        except AssertionError:
            raise AssertionError(f"published {expected}, sensed {sensed}") from None
        return sensed

    def expected(self, name: str, value: FloatArray) -> FloatArray:
        """The nearest to a reading that the wire can tell."""
        low, high = self.limits.get(name, (-np.inf, np.inf))
        return np.where(np.isfinite(value), np.clip(value, low, high), value)

    def near(self, name: str, sensed: FloatArray, expected: FloatArray) -> bool:
        """Whether they are the same but for the wire's resolution."""
        if sensed.shape != expected.shape or sensed.dtype != expected.dtype:
            return False
        ends = np.isinf(expected)
        off = np.where(ends, 0.0, sensed) - np.where(ends, 0.0, expected)
        if name == "compass.heading_rad":
            off = np.arctan2(np.sin(off), np.cos(off))
        return bool((np.where(ends, sensed == expected, np.abs(off) <= self.resolution[name])).all())

    def pop_commands(self) -> Commands:
        """What the driver's robot was told since the last call."""
        commands, driven = self.gateway.pop_commands(), Commands()
        if commands.drive[0]:
            driven.speeds.append((float(commands.linear_mps[0]), float(commands.angular_radps[0])))
        leds = commands.leds
        driven.leds.update({int(w): int(c) for r, w, c in zip(leds.rows, leds.slot, leds.value, strict=True) if r == 0})
        assert not commands.drive[NEIGHBOUR]
        return driven

    def until_told(self, linear_mps: float, angular_radps: float) -> None:
        """Wait until the robot was told these speeds last; fails if it is not."""
        last: list[Any] = []

        def is_told() -> bool:
            last[:] = self.pop_commands().speeds or last
            return bool(last) and self.same_speeds(last[0], (linear_mps, angular_radps))

        try:
            until(is_told)
        except AssertionError:
            raise AssertionError(f"expected {linear_mps, angular_radps}, told {last}") from None

    def same_speeds(self, one: tuple[float, float], other: tuple[float, float]) -> bool:
        """Whether they are the same but for the wire's resolution."""
        return all(abs(a - b) <= off for a, b, off in zip(one, other, self.speed_resolution, strict=True))

    def close(self) -> None:
        """End whatever still runs."""
        for driver in self._drivers:
            driver.close()
        self.gateway.close()


class OwnWireRig(Rig):
    """A rig on whose wire is this project's own to read, over TCP."""

    @abstractmethod
    def address_of_link(self) -> tuple[str, int]:
        """Where a TCP proxy has to connect to."""


def readings(turn_radps: float) -> Fields:
    """The IMU of a robot that turns at this rate."""
    return {"imu.forward_mps2": np.zeros(1), "imu.left_mps2": np.zeros(1), "imu.turn_radps": np.array([turn_radps])}


def opened(driver: Driver) -> bool:
    """Whether the driver could be opened."""
    try:
        driver.open()
    except DriverLost:
        return False
    return True


def sense_until_lost(rig: Rig) -> None:
    """Read on until the driver says that its robot is lost."""

    def lost() -> bool:
        try:
            rig.driver.sense(rig.driver.measures)
        except DriverLost:
            return True
        return False

    until(lost)


def made_up_readings(body: Body, readings: frozenset[str]) -> st.SearchStrategy[Fields]:
    """Fields of these sensors, (1,) or (1, width) each; not of odometry, which cannot jump."""
    made = [_FIELDS[name](body) for name in sorted(readings) if name in _FIELDS]
    return st.tuples(*made).map(lambda parts: {name: value for part in parts for name, value in part.items()})


def _wide(name: str, width: int, numbers: st.SearchStrategy[float]) -> st.SearchStrategy[Fields]:
    return st.lists(numbers, min_size=width, max_size=width).map(lambda values: {name: np.array([values])})


def _numbers(**numbers: st.SearchStrategy[float]) -> st.SearchStrategy[Fields]:
    return st.fixed_dictionaries(numbers).map(
        lambda values: {name.replace("__", "."): np.array([value]) for name, value in values.items()}
    )


def _proximity(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["proximity"]
    assert isinstance(sheet, ProximitySpec)
    return _wide("proximity.value", len(sheet.angles_deg), _SHARE)


def _light(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["light"]
    assert isinstance(sheet, LightSpec)
    return _wide("light.value", len(sheet.angles_deg), _SHARE)


def _ground(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["ground"]
    assert isinstance(sheet, GroundSpec)
    return _wide("ground.shade", len(sheet.points_m), _SHARE)


def _scan(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["scan"]
    assert isinstance(sheet, ScanSpec)
    ranges = st.one_of(st.floats(sheet.range_min_m, 0.999 * sheet.range_m), st.just(inf))
    return _wide("scan.range_m", sheet.rays, ranges)


def _imu(body: Body) -> st.SearchStrategy[Fields]:
    acceleration, turn = st.floats(-30.0, 30.0), st.floats(-6.0, 6.0)
    return _numbers(imu__forward_mps2=acceleration, imu__left_mps2=acceleration, imu__turn_radps=turn)


def _battery(body: Body) -> st.SearchStrategy[Fields]:
    sheet = body.sensors["battery"]
    assert isinstance(sheet, BatterySpec)

    def fields(charge: float) -> Fields:
        voltage_v = sheet.empty_v + charge * (sheet.full_v - sheet.empty_v)
        return {"battery.charge": np.array([charge]), "battery.voltage_v": np.array([voltage_v])}

    return _SHARE.map(fields)


_FIELDS: dict[str, Callable[[Body], st.SearchStrategy[Fields]]] = {
    "proximity": _proximity,
    "light": _light,
    "ground": _ground,
    "scan": _scan,
    "imu": _imu,
    "bumper": lambda _: st.sampled_from([0.0, 1.0]).map(lambda pressed: {"bumper.pressed": np.array([pressed])}),
    "compass": lambda _: _numbers(compass__heading_rad=st.floats(-pi, pi)),
    "flow": lambda _: _numbers(flow__forward_mps=_SPEED, flow__left_mps=_SPEED),
    "positioning": lambda _: _numbers(positioning__x_m=_POSITION, positioning__y_m=_POSITION),
    "battery": _battery,
}
