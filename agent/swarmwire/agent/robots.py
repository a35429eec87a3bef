"""Robots: the handle through which a VectorAgent's step reads and moves n robots; and the robots' random draws.

A draw is keyed by robot, tick, purpose and the number of the call for that purpose, so it does not depend on other
robots, nor on the process that draws.
"""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.agent.packet import Packets
from swarmwire.agent.step_context import GroupContext, StepContext
from swarmwire.comms.base import draws
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.clock import to_s
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import rgb_of, twist_of_wheels
from swarmwire.comms.robot.messages import Message, encode_rows, message_class
from swarmwire.comms.robot.packets import TxStatuses
from swarmwire.comms.robot.sensors import Sensors
from swarmwire.comms.robot.sensors.sensor import CustomReading, SensorProperty

M = TypeVar("M", bound=Message)
N = TypeVar("N", float, FloatArray)


class RobotHandle(Sensors[N]):
    """A view of one tick of one group: time, body, and the sensors of one robot, or of n robots with a leading axis."""

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


class _Calls:
    """The number of calls for each purpose in one tick."""

    def __init__(self, first: int) -> None:
        """Begin; `first` numbers the first call for each purpose, above those of earlier draws in this tick."""
        self._first = first
        self._calls: dict[str, int] = {}

    def _count(self, purpose: str) -> int:
        call = self._calls.get(purpose, self._first)
        self._calls[purpose] = call + 1
        return call


class Draws(_Calls):
    """Draws of n robots in one tick; a second call for a purpose gives new values."""

    def __init__(self, keys: KeyArray, tick: int, first: int = 0) -> None:
        super().__init__(first)
        self._keys, self._tick = keys, tick

    def uniform(self, purpose: str, low: float = 0.0, high: float = 1.0) -> FloatArray:
        """Uniform in [low, high), (n,)."""
        unit = draws.uniform(self._keys, self._tick, self._count(purpose), 0, draws.purpose(purpose))
        return low + (high - low) * unit

    def normal(self, purpose: str, mean: float = 0.0, deviation: float = 1.0) -> FloatArray:
        """Normal with this mean and standard deviation, (n,)."""
        unit = draws.normal(self._keys, self._tick, self._count(purpose), 0, draws.purpose(purpose))
        return mean + deviation * unit


class Draw(_Calls):
    """Draws of one robot in one tick; a second call for a purpose gives a new value."""

    def __init__(self, key: int, tick: int, first: int = 0) -> None:
        super().__init__(first)
        self._key, self._tick = key, tick

    def uniform(self, purpose: str, low: float = 0.0, high: float = 1.0) -> float:
        """Uniform in [low, high)."""
        unit = draws.uniform_one(self._key, self._tick, self._count(purpose), 0, draws.purpose(purpose))
        return low + (high - low) * unit

    def normal(self, purpose: str, mean: float = 0.0, deviation: float = 1.0) -> float:
        """Normal with this mean and standard deviation."""
        unit = draws.normal_one(self._key, self._tick, self._count(purpose), 0, draws.purpose(purpose))
        return mean + deviation * unit


class Robots(RobotHandle[FloatArray]):
    """n robots of one group in one tick; arrays have a leading axis n. Sensors that `needs` lacks raise NotDeclared."""

    __slots__ = ("draw", "radio")

    _context: GroupContext

    def __init__(self, context: GroupContext) -> None:
        super().__init__(context)
        self.radio = RadioRows(context)  #: the radios of the robots
        self.draw = Draws(context.keys, context.tick, context.first_draw)  #: the random draws of the robots

    @property
    def n(self) -> int:
        """Number of robots that act in this tick in this process; it is not the size of the swarm."""
        return self._context.n

    def sensor(self, name: str) -> CustomReading:
        """Return the reading of a custom sensor: each field is an attribute, (n,) or (n, width)."""
        return CustomReading(name, self._context.fields(name))

    def drive(
        self,
        linear_mps: ArrayLike,
        angular_radps: ArrayLike,
        lateral_mps: ArrayLike = 0.0,
        rows: BoolArray | None = None,
    ) -> None:
        """Command forward speed and turn rate, (n,) or one number, of all robots or of the mask `rows`.

        Commands apply until the next. Bodies with a holonomic drive can also move sideways, positive to the left.
        """
        context = self._context
        mask = None if rows is None else context.mask(rows)
        for column, speed in (
            (context.drive, True),
            (context.linear_mps, linear_mps),
            (context.angular_radps, angular_radps),
            (context.lateral_mps, lateral_mps),
        ):
            if mask is None:
                column[...] = speed  # takes a third of the time of copyto
            else:
                np.copyto(column, speed, where=mask)

    def wheels(self, left_mps: ArrayLike, right_mps: ArrayLike, rows: BoolArray | None = None) -> None:
        """Command the speeds of two wheels, (n,) or one number; IncompatibleBody if the bodies have none."""
        left, right = np.asarray(left_mps, np.float64), np.asarray(right_mps, np.float64)
        self.drive(*twist_of_wheels(left, right, self.body.wheels.wheel_base_m), rows=rows)

    def led(
        self,
        red: ArrayLike,
        green: ArrayLike,
        blue: ArrayLike,
        index: int | None = None,
        rows: BoolArray | None = None,
    ) -> None:
        """Set the colour of all LEDs, or of LED `index`, of the robots of the mask `rows`, or of all robots.

        Each share, 0 to 1, is (n,) or one number; all 0: dark. The colour lasts until the next call. IncompatibleBody
        if the bodies have no LEDs, ValueError if they lack this one.
        """
        mask = True if rows is None else self._context.mask(rows)[:, None]
        np.copyto(self._context.leds(index), rgb_of(red, green, blue)[..., None], where=mask)

    def actuate(self, name: str, values: ArrayLike, rows: BoolArray | None = None) -> None:
        """Set a custom actuator of the robots of the mask `rows`, or of all.

        `values` is one number, (n,), (n, width) or, for a width above 1, (width,) for every robot; numbers of robots
        outside the mask are ignored. The actuator defines their effect and its duration. IncompatibleBody if the bodies
        have none of this name, ValueError for a wrong shape or if a number is not finite.
        """
        self._context.actuate(name, values, slice(None), None if rows is None else self._context.mask(rows))

    def note(self, state: str | None = None, rows: BoolArray | None = None, *, value: ArrayLike | None = None) -> None:
        """Note a state of the robots of the mask `rows`, or of all, and a number of each, for observers of the run.

        States are for recordings and pictures, numbers for recordings and metrics (`consensus_error`); each is valid
        until the next note. `value` is (n,) or one number for all; numbers of robots outside the mask are ignored.
        ValueError if both are None, for a state that is no short text, and for numbers of a wrong shape or not finite.
        """
        self._context.note(slice(None) if rows is None else self._context.mask(rows), state, value)

    def _reading(self, sensor: SensorProperty[Any, Any]) -> Any:
        columns = self._context.columns(sensor)
        return (
            sensor.make_readings(*columns, self.body.sensors[sensor.name])
            if sensor.has_spec
            else sensor.make_readings(*columns)
        )


class RadioRows:
    """The radios of n robots: an unreliable medium."""

    def __init__(self, context: GroupContext) -> None:
        self._context = context

    def received(self, kind: type[M]) -> Packets[M]:
        """Return all packets of a message class received since the robots' last step."""
        return self._context.packets(kind)

    @property
    def tx_status(self) -> TxStatuses:
        """Results of unicast packets since the last step: row (0 to n - 1), id, result."""
        return self._context.tx_status()

    def send(
        self,
        kind: type[Message],
        /,
        rows: BoolArray | None = None,
        to: IntArray | int | None = None,
        **fields: ArrayLike,
    ) -> IntArray:
        """Send a message from each robot, or those of the mask `rows`; each field is (n,) or one number.

        It is a broadcast, or goes to the robot of index `to` in the arena, one number or (n,).

        Returns the ids of the packets, in the order of the robots that sent.
        """
        message_class(kind)
        if rows is None:
            return self._context.send(None, to, encode_rows(kind, self._context.n, fields))
        row = np.flatnonzero(self._context.mask(rows))
        columns = {name: _masked(rows, value) for name, value in fields.items()}
        return self._context.send(row, None if to is None else _masked(rows, to), encode_rows(kind, len(row), columns))


def _masked(rows: BoolArray, value: Any) -> Any:
    """Return the values of the rows of a mask; one number is returned unchanged."""
    if np.ndim(value) == 0:
        return value
    if np.shape(value) != (len(rows),):
        raise ValueError(f"expected one number or an array ({len(rows)},), also with rows=, got {np.shape(value)}")
    return np.asarray(value)[rows]
