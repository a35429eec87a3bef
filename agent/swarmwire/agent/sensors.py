"""Base classes of the handles `Robot` and `Robots`: time, body, and one property per sensor.

The properties are the same for one robot and for n robots, whose arrays have a leading axis n (here written …). The
sensors whose readings differ in form, bumper and camera, are in `robot.py` and `robots.py`.
"""

from abc import abstractmethod
from typing import Generic, TypeVar

from swarmwire.agent.readings import (
    BatteryReading,
    CompassReading,
    GroundReading,
    ImuReading,
    InfraredReading,
    LightReading,
    N,
    OdometryReading,
    PositioningReading,
    ProximityReading,
    ScanReading,
)
from swarmwire.agent.step_context import StepContext
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.spec import SensorSpec
from swarmwire.comms.clock import to_s

S = TypeVar("S", bound=SensorSpec)


class RobotHandle:
    """A view of one tick of one group."""

    __slots__ = ("_context",)

    def __init__(self, context: StepContext) -> None:
        self._context = context

    @property
    def time_s(self) -> float:
        """Time since the start of the run, at this tick."""
        return to_s(self._context.time_ns)

    @property
    def period_s(self) -> float:
        """Time between two steps."""
        return to_s(self._context.period_ns)

    @property
    def body(self) -> Body:
        """Geometry and limits of the body."""
        return self._context.group.body


class Sensors(RobotHandle, Generic[N]):
    """The sensors of one robot, or of n robots with a leading axis n, here written …."""

    __slots__ = ()  # an attribute set on a handle by mistake raises

    @abstractmethod
    def _number(self, sensor: str, field: str) -> N:
        """A field with one number per robot."""

    @abstractmethod
    def _numbers(self, sensor: str, field: str) -> FloatArray:
        """A field with several numbers per robot, (…, width)."""

    @property
    def proximity(self) -> ProximityReading[N]:
        """Rays around the body: value and distance_m (…, rays), angle_rad (rays,)."""
        return ProximityReading(self._numbers("proximity", "value"), _checked(self.body.proximity))

    @property
    def compass(self) -> CompassReading[N]:
        """Heading in the arena's frame: heading_rad."""
        return CompassReading(self._number("compass", "heading_rad"))

    @property
    def odometry(self) -> OdometryReading[N]:
        """Wheel encoders: left_m and right_m."""
        return OdometryReading(self._number("odometry", "left_m"), self._number("odometry", "right_m"))

    @property
    def light(self) -> LightReading[N]:
        """Photocells around the body: value (…, cells), angle_rad (cells,)."""
        return LightReading(self._numbers("light", "value"), _checked(self.body.light))

    @property
    def positioning(self) -> PositioningReading[N]:
        """Position in the arena's frame: x_m and y_m."""
        return PositioningReading(self._number("positioning", "x_m"), self._number("positioning", "y_m"))

    @property
    def imu(self) -> ImuReading[N]:
        """Acceleration and turn rate in the body's frame: forward_mps2, left_mps2 and turn_radps."""
        return ImuReading(*(self._number("imu", name) for name in ("forward_mps2", "left_mps2", "turn_radps")))

    @property
    def battery(self) -> BatteryReading[N]:
        """Battery: charge, 1 full and 0 empty, and voltage_v."""
        return BatteryReading(self._number("battery", "charge"), self._number("battery", "voltage_v"))

    @property
    def infrared(self) -> InfraredReading[N]:
        """Light of other robots, by rays around the body: value and distance_m (…, rays), angle_rad (rays,)."""
        return InfraredReading(self._numbers("infrared", "value"), _checked(self.body.infrared))

    @property
    def scan(self) -> ScanReading:
        """Laser scan: range_m (…, rays), angle_rad (rays,)."""
        return ScanReading(self._numbers("scan", "range_m"), _checked(self.body.scan))

    @property
    def ground(self) -> GroundReading:
        """Shade of the floor under the sensors: shade (…, points)."""
        return GroundReading(self._numbers("ground", "shade"))


def _checked(spec: S | None) -> S:
    """The spec of a sensor; AttributeError if the body lacks it (needs are checked before a run)."""
    if spec is None:
        raise AttributeError("the body does not have this sensor")
    return spec
