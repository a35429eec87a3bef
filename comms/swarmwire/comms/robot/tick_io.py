"""The arrays that cross between world and agent backend in a tick: readings one way, actions the other.

`Readings` are what the robots' sensors read. `Actions` are the robots' drive commands, packets, notes, LED colours,
actuator commands, noted values and motor switches. Notes and values are for observers: they change nothing in the run.
Each of the last five is a `SparseTable`: rows for the robots that set something, none for the others.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.robot.packets import SentPackets

MAX_STATE = 64  # characters of a state
MAX_STATES = 256  # different states in a run, and in one tick of a runner


@dataclass(frozen=True, slots=True)
class SparseTable:
    """Numbers that robots set in one tick, a row each; the last row of a robot and place counts.

    Colours and names are numbers, too: 0xRRGGBB, and indices in `names`.
    """

    rows: IntArray  # (k,) robot row: arena x robots + index
    place: IntArray  # (k,) which of the robot's LEDs or other numbers; 0 where a robot has one
    value: FloatArray  # (k,) finite
    names: tuple[str, ...] = ()  # if `value` is an index

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def integers(self) -> IntArray:
        """The values of a table of integers, (k,)."""
        return self.value.astype(np.int64)

    def select(self, index: IntArray) -> "SparseTable":
        """The rows of `index` (k,), in its order."""
        return replace(self, rows=self.rows[index], place=self.place[index], value=self.value[index])

    @classmethod
    def of(cls, rows: IntArray, values: FloatArray, names: tuple[str, ...] = ()) -> "SparseTable":
        """The numbers of robots `rows` (n,) that are set in `values` (n, places); NaN: not set."""
        at, place = np.nonzero(~np.isnan(values))
        return cls(rows[at], place, values[at, place], names)

    @classmethod
    def joined(cls, parts: "list[SparseTable]") -> "SparseTable":
        """The rows of all parts, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NOTHING_SET
        names = tuple(dict.fromkeys(name for part in parts for name in part.names))
        if names:
            index_of = {name: float(index) for index, name in enumerate(names)}
            values = [np.array([index_of[name] for name in part.names])[part.integers] for part in parts]
        else:
            values = [part.value for part in parts]
        rows, place = ([getattr(part, column) for part in parts] for column in ("rows", "place"))
        return cls(np.concatenate(rows), np.concatenate(place), np.concatenate(values), names)


NOTHING_SET = SparseTable(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))


def checked_state(state: object) -> str:
    """Return the state; ValueError unless it is a text of 1 to 64 characters."""
    if not isinstance(state, str) or not 0 < len(state) <= MAX_STATE:
        raise ValueError(f"note(state=…): expected a text of 1 to {MAX_STATE} characters, got {state!r}")
    return state


@dataclass(frozen=True, slots=True)
class GroupReadings:
    """The sensor readings of the robots of one group, a row per robot.

    `ages_ticks` is how long before this tick a sensor measured; it stays in the world.
    """

    rows: IntArray  # (n,) robot row: arena x robots + index, rising
    fields: dict[str, FloatArray]  # "sensor.field" -> (n,) or (n, width), C-contiguous
    ages_ticks: dict[str, int | None] = field(default_factory=dict[str, int | None])  # if not 0; None: not yet


Readings = dict[str, GroupReadings]  # by group


@dataclass(frozen=True, slots=True)
class Actions:
    """The actions of the robots whose agents stepped in one tick, a row per robot."""

    rows: IntArray  # (n,) robot row: arena x robots + index
    drive: BoolArray  # (n,) False: no command in this tick, the last one holds
    linear_mps: FloatArray  # (n,) commanded forward speed
    angular_radps: FloatArray  # (n,) commanded turn rate, positive to the left
    lateral_mps: FloatArray  # (n,) commanded speed to the left; 0 except for holonomic bodies
    sent: SentPackets = field(default_factory=SentPackets.none)
    notes: SparseTable = NOTHING_SET  # states that agents named, such as `note(state="search")`; each robot once
    leds: SparseTable = NOTHING_SET  # place: the LED in the body's spec; other LEDs keep their colours
    actuators: SparseTable = NOTHING_SET  # place: among the numbers of all custom actuators of the body
    values: SparseTable = NOTHING_SET  # numbers that agents noted, such as `note(value=1.25)`
    motors: SparseTable = NOTHING_SET  # of flying bodies: 1 on, 0 off (on the floor), until the next; only gateways

    def of(self, rows: IntArray) -> "Actions":
        """The part of these robot rows, (m,)."""
        kept = np.isin(self.rows, rows)
        tables = {name: getattr(self, name) for name in TABLES}
        return Actions(
            self.rows[kept],
            self.drive[kept],
            self.linear_mps[kept],
            self.angular_radps[kept],
            self.lateral_mps[kept],
            self.sent.select(np.flatnonzero(np.isin(self.sent.sender, rows))),
            **{name: table.select(np.flatnonzero(np.isin(table.rows, rows))) for name, table in tables.items()},
        )

    @classmethod
    def joined(cls, parts: "list[Actions]") -> "Actions":
        """The actions of all parts."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            nothing = np.empty(0, np.int64)
            none = nothing.astype(float)
            return cls(nothing, nothing.astype(bool), none, none, none)
        return cls(
            np.concatenate([part.rows for part in parts]),
            np.concatenate([part.drive for part in parts]),
            np.concatenate([part.linear_mps for part in parts]),
            np.concatenate([part.angular_radps for part in parts]),
            np.concatenate([part.lateral_mps for part in parts]),
            SentPackets.joined([part.sent for part in parts]),
            **joined_tables(parts),
        )


TABLES = ("notes", "leds", "actuators", "values", "motors")  # the sparse tables of `Actions`


def joined_tables(parts: list[Actions]) -> dict[str, SparseTable]:
    """The sparse tables of all parts, joined, by name."""
    return {name: SparseTable.joined([getattr(part, name) for part in parts]) for name in TABLES}
