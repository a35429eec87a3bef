"""The arrays that cross between world and agent backend in a tick: readings to the agents, actions to the world.

`Readings` hold the robots' sensor readings. `Actions` hold their drive commands, packets, notes, LED colours, actuator
commands, noted values, motor switches and poses from outside. Notes and values are for observers and do not affect the
run. The last six are `SparseTable`s, with rows only for robots that set a number in the tick.
"""

from dataclasses import field, replace

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.tick_record import tick_record
from swarmwire.comms.robot.packets import SentPackets

MAX_STATE = 64  # characters in the name of a state
MAX_STATES = 256  # different states in a run, and in one tick of a runner


@tick_record
class SparseTable:
    """Numbers that robots set in one tick; of several rows with the same robot and slot, the last one applies.

    Colours are numbers 0xRRGGBB; names are indices in `names`.
    """

    rows: IntArray  # (k,) robot row: arena x robots + index
    slot: IntArray  # (k,) index among the robot's LEDs or other numbers; 0 if a robot has a single number
    value: FloatArray  # (k,) finite
    names: tuple[str, ...] = ()  # names that the values are indices of; empty in a table of numbers

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def integers(self) -> IntArray:
        """The values of a table of integers, (k,)."""
        return self.value.astype(np.int64)

    def select(self, index: IntArray) -> "SparseTable":
        """The rows `index` (k,), in its order."""
        return replace(self, rows=self.rows[index], slot=self.slot[index], value=self.value[index])

    @classmethod
    def from_dense(cls, rows: IntArray, values: FloatArray, names: tuple[str, ...] = ()) -> "SparseTable":
        """The table of the numbers of robots `rows` (n,) that are set in `values` (n, slots); NaN: not set."""
        index, slot = np.nonzero(~np.isnan(values))
        return cls(rows[index], slot, values[index, slot], names)

    @classmethod
    def joined(cls, parts: "list[SparseTable]") -> "SparseTable":
        """The rows of all parts, in order, with one list of names."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NOTHING_SET
        names = tuple(dict.fromkeys(name for part in parts for name in part.names))
        if names:
            index_of = {name: float(index) for index, name in enumerate(names)}
            values = [np.array([index_of[name] for name in part.names])[part.integers] for part in parts]
        else:
            values = [part.value for part in parts]
        rows, slot = ([getattr(part, column) for part in parts] for column in ("rows", "slot"))
        return cls(np.concatenate(rows), np.concatenate(slot), np.concatenate(values), names)


NOTHING_SET = SparseTable(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))


def checked_state(state: object) -> str:
    """Return the name of a state; ValueError unless it is a text of 1 to 64 characters."""
    if not isinstance(state, str) or not 0 < len(state) <= MAX_STATE:
        raise ValueError(f"note(state=…): expected a text of 1 to {MAX_STATE} characters, got {state!r}")
    return state


@tick_record
class GroupReadings:
    """The sensor readings of the robots of one group, a row per robot.

    `ages_ticks` is the time from a sensor's measurement to this tick; it stays in the world.
    """

    rows: IntArray  #: (n,) robot row: arena x robots + index, rising
    fields: dict[str, FloatArray]  #: "sensor.field" -> (n,) or (n, width), C-contiguous
    # Ages above 0, by sensor; None: the sensor has not measured yet.
    ages_ticks: dict[str, int | None] = field(default_factory=dict[str, int | None])


Readings = dict[str, GroupReadings]  # name of the group: readings of its robots


@tick_record
class Actions:
    """The actions of the robots whose agents stepped in one tick, a row per robot."""

    rows: IntArray  # (n,) robot row: arena x robots + index
    drive: BoolArray  # (n,) False: no command in this tick, the last command stays in effect
    linear_mps: FloatArray  # (n,) commanded forward speed
    angular_radps: FloatArray  # (n,) commanded turn rate, positive to the left
    lateral_mps: FloatArray  # (n,) commanded speed to the left; 0 except for holonomic bodies
    sent: SentPackets = field(default_factory=SentPackets.none)
    notes: SparseTable = NOTHING_SET  # states that agents noted by `note(state="search")`; at most one per robot
    leds: SparseTable = NOTHING_SET  # slot: index of the LED in the body's spec; other LEDs keep their colours
    actuators: SparseTable = NOTHING_SET  # slot: index among the numbers of all custom actuators of the body
    values: SparseTable = NOTHING_SET  # numbers that agents noted by `note(value=1.25)`
    motors: SparseTable = NOTHING_SET  # flying bodies: 1 on, 0 off (on the floor), until the next; only gateways
    poses: SparseTable = NOTHING_SET  # robots that a live source moves: slots x, y, z in m, heading; only that source

    def for_rows(self, rows: IntArray) -> "Actions":
        """The actions of the robots with these rows, (m,)."""
        selected = np.isin(self.rows, rows)
        tables = {name: getattr(self, name) for name in TABLES}
        return Actions(
            self.rows[selected],
            self.drive[selected],
            self.linear_mps[selected],
            self.angular_radps[selected],
            self.lateral_mps[selected],
            self.sent.select(np.flatnonzero(np.isin(self.sent.sender, rows))),
            **{name: table.select(np.flatnonzero(np.isin(table.rows, rows))) for name, table in tables.items()},
        )

    @classmethod
    def joined(cls, parts: "list[Actions]") -> "Actions":
        """The actions of all parts."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            no_rows, no_speeds = np.empty(0, np.int64), np.empty(0)
            return cls(no_rows, no_rows.astype(bool), no_speeds, no_speeds, no_speeds)
        return cls(
            np.concatenate([part.rows for part in parts]),
            np.concatenate([part.drive for part in parts]),
            np.concatenate([part.linear_mps for part in parts]),
            np.concatenate([part.angular_radps for part in parts]),
            np.concatenate([part.lateral_mps for part in parts]),
            SentPackets.joined([part.sent for part in parts]),
            **joined_tables(parts),
        )


TABLES = ("notes", "leds", "actuators", "values", "motors", "poses")  # names of the sparse tables of `Actions`


def joined_tables(parts: list[Actions]) -> dict[str, SparseTable]:
    """The joined sparse tables of all parts, by name."""
    return {name: SparseTable.joined([getattr(part, name) for part in parts]) for name in TABLES}
