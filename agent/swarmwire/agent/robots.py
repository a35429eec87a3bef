"""Random draws of robots, keyed by robot, tick and purpose: a draw does not depend on who else draws, or where."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.agent.packet import Packets
from swarmwire.agent.readings import BumperReadings, CameraReadings, CustomReading
from swarmwire.agent.sensors import Sensors
from swarmwire.agent.step_context import StepContext
from swarmwire.comms import draws
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.bodies.drives import rgb_of
from swarmwire.comms.messages import Message, encode_rows, message_class
from swarmwire.comms.packets import TxStatuses


class Draws:
    """Draws of n robots in one tick; a second call for a purpose gives new values."""

    def __init__(self, keys: KeyArray, tick: int, first: int = 0) -> None:
        """`first` numbers the first call for each purpose: what was drawn before it in this tick is not drawn again."""
        self._keys, self._tick, self._first = keys, tick, first
        self._calls: dict[str, int] = {}

    def uniform(self, purpose: str, low: float = 0.0, high: float = 1.0) -> FloatArray:
        """Uniform in [low, high), (n,)."""
        unit = draws.uniform(self._keys, self._tick, self._count(purpose), 0, draws.purpose(purpose))
        return low + (high - low) * unit

    def normal(self, purpose: str, mean: float = 0.0, deviation: float = 1.0) -> FloatArray:
        """Normal with this mean and standard deviation, (n,)."""
        unit = draws.normal(self._keys, self._tick, self._count(purpose), 0, draws.purpose(purpose))
        return mean + deviation * unit

    def _count(self, purpose: str) -> int:
        call = self._calls.get(purpose, self._first)
        self._calls[purpose] = call + 1
        return call


class Draw:
    """Draws of one robot in one tick; a second call for a purpose gives a new value."""

    def __init__(self, keys: KeyArray, tick: int, first: int = 0) -> None:
        self._rows = Draws(keys, tick, first)

    def uniform(self, purpose: str, low: float = 0.0, high: float = 1.0) -> float:
        """Uniform in [low, high)."""
        return float(self._rows.uniform(purpose, low, high)[0])

    def normal(self, purpose: str, mean: float = 0.0, deviation: float = 1.0) -> float:
        """Normal with this mean and standard deviation."""
        return float(self._rows.normal(purpose, mean, deviation)[0])


# --- Robots: the handle through which a VectorAgent's step sees and moves n robots.


M = TypeVar("M", bound=Message)
N = TypeVar("N", float, FloatArray)


class Robots(Sensors[FloatArray]):
    """n robots of one group in one tick; every array has a leading axis n. Senses raise NotDeclared unless needed."""

    __slots__ = ("draw", "radio")

    def __init__(self, turn: StepContext) -> None:
        super().__init__(turn)
        self.radio = RadioRows(turn)
        self.draw = Draws(turn.keys, turn.tick, turn.first_draw)

    @property
    def n(self) -> int:
        """How many robots act in this tick in this process: says nothing about the swarm."""
        return self._turn.n

    @property
    def bumper(self) -> BumperReadings:
        """Bumpers: pressed (n,), 1 or 0."""
        return BumperReadings(self._number("bumper", "pressed"))

    @property
    def camera(self) -> CameraReadings:
        """LEDs of other robots in sight: distance_m, bearing_rad and colour (n, most_blobs), count (n,)."""
        return CameraReadings(*(self._numbers("camera", name) for name in ("distance_m", "bearing_rad", "colour")))

    def sensor(self, name: str) -> CustomReading:
        """What a sense of your own reads: each field as an attribute, (n,) or (n, width)."""
        return CustomReading(name, self._turn.fields(name))

    def drive(
        self,
        linear_mps: ArrayLike,
        angular_radps: ArrayLike,
        lateral_mps: ArrayLike = 0.0,
        rows: BoolArray | None = None,
    ) -> None:
        """Wanted forward speed and turn rate, (n,) or one number; outside the mask `rows` the last ones hold.

        Bodies with a holonomic drive can also move sideways, positive to the left.
        """
        turn = self._turn
        moved = True if rows is None else turn.mask(rows)
        np.copyto(turn.drive, True, where=moved)
        np.copyto(turn.linear_mps, linear_mps, where=moved)
        np.copyto(turn.angular_radps, angular_radps, where=moved)
        np.copyto(turn.lateral_mps, lateral_mps, where=moved)

    def wheels(self, left_mps: ArrayLike, right_mps: ArrayLike, rows: BoolArray | None = None) -> None:
        """Wanted speeds of the two wheels, (n,) or one number; NotFitted if the bodies have none."""
        left, right = np.asarray(left_mps, np.float64), np.asarray(right_mps, np.float64)
        self.drive(*forward_and_turn(left, right, self.body.wheels.wheel_base_m), rows=rows)

    def led(
        self,
        red: ArrayLike,
        green: ArrayLike,
        blue: ArrayLike,
        which: int | None = None,
        rows: BoolArray | None = None,
    ) -> None:
        """Colour of all LEDs, or of the one at place `which`, of the robots of the mask `rows`, or of all robots.

        Each share, 0 to 1, is (n,) or one number; all 0: dark. It holds until the next call. NotFitted if the bodies
        have no LEDs, ValueError if they have not that one.
        """
        here = True if rows is None else self._turn.mask(rows)[:, None]
        np.copyto(self._turn.leds(which), rgb_of(red, green, blue)[..., None], where=here)

    def actuate(self, name: str, values: ArrayLike, rows: BoolArray | None = None) -> None:
        """Set an actuator of your own of the robots of the mask `rows`, or of all.

        To one number, (n,), (n, width), or, of more than one, (width,) for each of them: of robots outside the mask
        they do not count. What they do, and for how long, is the actuator's to know. NotFitted if the bodies have none
        of this name, ValueError if the numbers do not fit or are not finite.
        """
        self._turn.actuate(name, values, slice(None), None if rows is None else self._turn.mask(rows))

    def note(self, state: str | None = None, rows: BoolArray | None = None, *, value: ArrayLike | None = None) -> None:
        """Name what the robots of the mask `rows`, or all, are at, and tell a number of each: for whoever looks on.

        States are for recordings and pictures, numbers for recordings and metrics (`consensus_error`); each holds until
        the next is given. `value` is (n,) or one number for each of them; of robots outside the mask it does not count.
        ValueError if neither is given, for a state that is no short text, for numbers that do not fit or are not
        finite.
        """
        self._turn.note(slice(None) if rows is None else self._turn.mask(rows), state, value)

    def _number(self, sensor: str, field: str) -> FloatArray:
        return self._turn.field(sensor, field)

    def _numbers(self, sensor: str, field: str) -> FloatArray:
        return self._turn.field(sensor, field)


class RadioRows:
    """The radios of n robots: an unreliable medium."""

    def __init__(self, turn: StepContext) -> None:
        self._turn = turn

    def received(self, kind: type[M]) -> Packets[M]:
        """All packets of a message class received since the robots' last step."""
        return self._turn.packets(kind)

    @property
    def tx_status(self) -> TxStatuses:
        """Packets sent to one robot that the radios are done with since the last step: row (0 to n - 1), id, result."""
        return self._turn.tx_status()

    def send(
        self,
        kind: type[Message],
        /,
        rows: BoolArray | None = None,
        to: IntArray | int | None = None,
        **fields: ArrayLike,
    ) -> IntArray:
        """Send a message from each robot, or those of the mask `rows`; each field is (n,) or one number.

        It goes to all who hear it, or to the robot of index `to` in the arena, one number or (n,).

        Returns the ids of the packets, in the order of the robots that sent.
        """
        message_class(kind)
        if rows is None:
            return self._turn.send(None, to, encode_rows(kind, self._turn.n, fields))
        row = np.flatnonzero(self._turn.mask(rows))
        columns = {name: _of(rows, value) for name, value in fields.items()}
        return self._turn.send(row, None if to is None else _of(rows, to), encode_rows(kind, len(row), columns))


def _of(rows: BoolArray, value: Any) -> Any:
    """The values of the rows of a mask; one number serves them all."""
    if np.ndim(value) == 0:
        return value
    if np.shape(value) != (len(rows),):
        raise ValueError(f"expected one number or an array ({len(rows)},), also with rows=, got {np.shape(value)}")
    return np.asarray(value)[rows]


def forward_and_turn(left_mps: N, right_mps: N, wheel_base_m: float) -> tuple[N, N]:
    """Forward speed and turn rate (positive to the left) of a body whose wheels roll so fast."""
    return 0.5 * (left_mps + right_mps), (right_mps - left_mps) / wheel_base_m
