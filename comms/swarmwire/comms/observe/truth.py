"""Ground truth for observers: `Static` once per run, `Truth` once per tick. Runners never get it.

`Truth` holds the state at the tick's start, the robots' actions in the tick and the results of the radio up to its
start: `ReceptionRecords` (a row per link), `TransmissionRecords` (a row per packet) and `PacketCounts` (a row per
arena).
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import inf
from typing import Any, Literal

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.floor import Floor
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.packets import Payloads, offsets
from swarmwire.comms.robot.tick_io import Readings

NO_ROBOT = -1  # in place of a robot index; as a receiver: all intended receivers of the packet
Boundary = Literal["walls", "open", "torus"]  # at the arena's edge: walls, nothing, or the opposite edge


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An object that stops bodies and rays; a cylinder has radius_m, a box size_m, a polygon points_m."""

    shape: str  # "cylinder" | "box" | "polygon"
    x_m: float
    y_m: float
    heading_rad: float = 0.0
    radius_m: float = 0.0
    size_m: tuple[float, float] = (0.0, 0.0)
    points_m: tuple[tuple[float, float], ...] = ()  # convex, counter-clockwise, around (x_m, y_m) at heading 0
    height_m: float = inf  # from the floor to its top; inf: taller than anything
    mass_kg: float | None = None  # of an obstacle that robots can push; None: it is fixed

    @property
    def movable(self) -> bool:
        """Whether robots can push it."""
        return self.mass_kg is not None

    def put_at(self, x_m: float, y_m: float, heading_rad: float) -> "Obstacle":
        """The same obstacle at another pose."""
        return replace(self, x_m=x_m, y_m=y_m, heading_rad=heading_rad)

    @property
    def corners_m(self) -> FloatArray:
        """Corners of a box or polygon in the arena's frame, counter-clockwise, (k, 2); a cylinder has none."""
        along, across = 0.5 * self.size_m[0], 0.5 * self.size_m[1]
        box = ((-along, -across), (along, -across), (along, across), (-along, across))
        points = np.array(box if self.shape == "box" else self.points_m, np.float64).reshape(-1, 2)
        c, s = np.cos(self.heading_rad), np.sin(self.heading_rad)
        x, y = points[:, 0], points[:, 1]
        return np.stack([self.x_m + (c * x - s * y), self.y_m + (s * x + c * y)], axis=1)


@dataclass(frozen=True, slots=True)
class Light:
    """A light that light sensors react to."""

    x_m: float
    y_m: float
    intensity_m: float  # reach of the light: ARGoS's I, in exp(-2 d / I)


@dataclass(frozen=True, slots=True)
class Group:
    """Robots of one kind: indices start to stop - 1 within every arena."""

    name: str
    body: Body
    start: int
    stop: int
    act_every_ticks: int = 1  # its robots act when the tick modulo this is 0


@dataclass(frozen=True, slots=True)
class Static:
    """The constant facts of a run. Robot row r is robot r % robots of arena r // robots."""

    name: str
    seeds: tuple[int, ...]  # of each arena
    rate_hz: int
    arena_size_m: tuple[float, float]  # full extents; the origin is the centre
    boundary: Boundary
    obstacles: tuple[tuple[Obstacle, ...], ...]  # of each arena
    groups: tuple[Group, ...]
    robot_names: tuple[str, ...]  # of each index within an arena
    range_m: float | None = None  # of the radio; None: no radio
    lights: tuple[tuple[Light, ...], ...] = ()  # of each arena
    floor: Floor | None = None  # of all arenas; None: white

    @property
    def walled(self) -> bool:
        """Whether walls stand around each arena."""
        return self.boundary == "walls"

    @property
    def movable(self) -> int:
        """How many obstacles of each arena robots can push."""
        return sum(obstacle.movable for obstacle in self.obstacles[0])

    def movable_at(self, arena: int, pose: AnyArray) -> tuple[Obstacle, ...]:
        """The movable obstacles of an arena at poses (k, 3)."""
        movable = (obstacle for obstacle in self.obstacles[arena] if obstacle.movable)
        return tuple(obstacle.put_at(*row) for obstacle, row in zip(movable, pose.tolist(), strict=True))

    def fixed(self, arena: int) -> tuple[Obstacle, ...]:
        """The obstacles of an arena that robots cannot push."""
        return tuple(obstacle for obstacle in self.obstacles[arena] if not obstacle.movable)

    @property
    def arenas(self) -> int:
        """How many arenas the world holds."""
        return len(self.seeds)

    @property
    def robots(self) -> int:
        """Robots in each arena."""
        return len(self.robot_names)

    @property
    def max_leds(self) -> int:
        """LEDs of the robot that has the most."""
        return max(group.body.led_count for group in self.groups)

    @property
    def act_every_ticks(self) -> IntArray:
        """Each robot index acts when the tick modulo this is 0, (robots,)."""
        return np.concatenate([np.full(group.stop - group.start, group.act_every_ticks) for group in self.groups])


@dataclass(frozen=True, slots=True)
class ReceptionRecords:
    """Links whose fate became final since the last tick: a row per (packet, receiver it might have reached).

    A packet that never went on air (queue full, too large, sender dead, its radio off) has one row with receiver -1.
    Receivers out of range appear in `PacketCounts` only.
    """

    arena: IntArray  # (k,)
    sender: IntArray  # (k,) index in the arena
    receiver: IntArray  # (k,) index in the arena; -1: all intended receivers
    receivers: IntArray  # (k,) number of intended receivers in this row: 1, or all of them
    to: IntArray  # (k,) index in the arena of the addressed robot; -1: a broadcast
    sequence: IntArray  # (k,)
    sent_at_ns: IntArray  # (k,)
    on_air_at_ns: IntArray  # (k,)
    final_at_ns: IntArray  # (k,) end of the reception, with any fate
    fate: IntArray  # (k,) a Fate
    size_bytes: IntArray  # (k,) payload with its tag
    tag: IntArray  # (k,) class of the message
    rssi_dbm: FloatArray | None = None  # (k,) strength at the receiver; None: this radio model has none
    payload: IntArray | None = None  # (k,) row of `payloads`; None: not known
    payloads: Payloads | None = None

    def of(self, arenas: BoolArray) -> "ReceptionRecords":
        """The links of the selected arenas (arenas,)."""
        index = np.flatnonzero(arenas[self.arena])
        columns = {name: column[index] for name, column in _columns(self).items()}
        return replace(self, **columns)

    @classmethod
    def joined(cls, parts: "list[ReceptionRecords]") -> "ReceptionRecords":
        """The links of all parts, one or more; all have the same optional columns."""
        filled = [part for part in parts if len(part.arena)]
        if len(filled) < 2:
            return filled[0] if filled else parts[0]
        columns = _joined_columns(filled)
        if all(part.payload is not None and part.payloads is not None for part in filled):
            tables = [part.payloads for part in filled if part.payloads is not None]
            first = offsets(np.array([len(table) for table in tables]))
            columns["payload"] += np.repeat(first[:-1], [len(part.arena) for part in filled])
            return replace(filled[0], **columns, payloads=Payloads.joined(tables))
        return replace(filled[0], **columns)


@dataclass(frozen=True, slots=True)
class TransmissionRecords:
    """Packets whose transmission ended since the last tick, a row each: they came off air, or never went on air.

    The times of a packet that was retransmitted are those of one attempt.
    """

    arena: IntArray  # (k,)
    sender: IntArray  # (k,) index in the arena
    to: IntArray  # (k,) index of the one receiver, or BROADCAST
    sequence: IntArray  # (k,)
    intended: IntArray  # (k,) number of intended receivers
    out_of_range: IntArray  # (k,) of these, receivers out of range; 0 if the packet was never on air
    fate: IntArray  # (k,) a Fate; RECEIVED: it was on air; another: the reason why not
    on_air_at_ns: IntArray  # (k,)
    off_air_at_ns: IntArray  # (k,) equal to on_air_at_ns if the packet was never on air

    def of(self, arenas: BoolArray) -> "TransmissionRecords":
        """The packets of the selected arenas (arenas,)."""
        index = np.flatnonzero(arenas[self.arena])
        return TransmissionRecords(**{name: column[index] for name, column in _columns(self).items()})

    @classmethod
    def joined(cls, parts: "list[TransmissionRecords]") -> "TransmissionRecords":
        """The packets of all parts, one or more."""
        return cls(**_joined_columns([part for part in parts if len(part.arena)] or parts[:1]))


def _columns(table: ReceptionRecords | TransmissionRecords) -> dict[str, Any]:
    """The arrays of a table by name, without those that are None; `payloads` is no array."""
    columns = ((field.name, getattr(table, field.name)) for field in fields(table) if field.name != "payloads")
    return {name: column for name, column in columns if column is not None}


def _joined_columns(tables: Sequence[ReceptionRecords] | Sequence[TransmissionRecords]) -> dict[str, Any]:
    """The arrays of tables with the same columns, by name, concatenated."""
    return {name: np.concatenate([getattr(table, name) for table in tables]) for name in _columns(tables[0])}


@dataclass(frozen=True, slots=True)
class PacketCounts:
    """Packets counted since the last tick, a row per arena. Over a run the fates add up to the intended receivers."""

    sent: IntArray  # (arenas,) packets handed to the radio
    intended: IntArray  # (arenas,) intended receivers of these packets
    in_range: IntArray  # (arenas,) receivers in range after path loss and walls, of the fates that became final
    fates: IntArray  # (arenas, fates) fates that became final

    def __add__(self, other: "PacketCounts") -> "PacketCounts":
        """The sums of both."""
        return PacketCounts(
            self.sent + other.sent,
            self.intended + other.intended,
            self.in_range + other.in_range,
            self.fates + other.fates,
        )

    def of(self, arenas: BoolArray) -> "PacketCounts":
        """The counts of the selected arenas (arenas,), and 0 in the others."""
        return PacketCounts(
            self.sent * arenas, self.intended * arenas, self.in_range * arenas, self.fates * arenas[:, None]
        )


BATTERY_EMPTY = "run_down"  # what an event does that is not from the scenario


@dataclass(frozen=True, slots=True)
class EventRecord:
    """An event that began in this tick, or one that ended after its time."""

    serial: int  # its index in the scenario; -1: it is not from the scenario
    at_s: float  # its time in the scenario; if `singly`, the tick's start
    do: str  # the action, or run_down: batteries are empty
    ended: bool
    changed: BoolArray  # (rows,) the robots that it changed
    part: str = ""  # the part that fails; empty for other actions
    singly: bool = False  # it befalls each robot at another time; arenas without a changed robot are not affected

    @property
    def words(self) -> str:
        """The event as a text: the action, its part if it has one, and "ended" if it ended."""
        return f"{self.do}{f' {self.part}' if self.part else ''}{' ended' if self.ended else ''}"


@dataclass(frozen=True, slots=True)
class Truth:
    """One tick: the state at its start, the robots' actions in it, and the radio's results up to its start.

    In an arena that has left the world no robot is alive, nothing moves, is received or happens, and its rows keep
    their last values.
    """

    tick: int
    time_ns: int
    running: BoolArray  # (arenas,) False: the arena has left the world
    alive: BoolArray  # (rows,)
    pose: FloatArray  # (rows, 3) x, y in m, heading in rad, arena frame
    velocity: FloatArray  # (rows, 3) m/s, m/s, rad/s, arena frame
    command: FloatArray  # (rows, 3) within the drive's limits: forward m/s, left turn rad/s, to the left m/s
    state: IntArray  # (rows,) index in `states` of the last state that the agent noted; 0: none
    states: tuple[str, ...]  # all states noted so far, in order; the first is empty
    leds: IntArray  # (rows, max LEDs of a robot) 0xRRGGBB as set in this tick; 0: dark, or no LED
    readings: Readings  # by group, of the robots that act in this tick, taken at its start
    contact_onsets: IntArray  # (arenas, 2) contacts that began in this tick: between robots, with walls or obstacles
    edges: IntArray | None  # (e, 2) robot rows joined in the radio graph at the tick's start; None without a radio
    tally: PacketCounts | None  # None without a radio
    finished: ReceptionRecords | None  # None without a radio
    events: tuple[EventRecord, ...] = ()  # at the tick's start, in order
    departed: TransmissionRecords | None = None  # None without a radio, and for live observers
    movable: FloatArray | None = None  # (arenas, movable obstacles, 3) x, y, heading; None: no movable obstacles
    # (rows,) last noted value, NaN: none; None: no agent has noted any yet, and for live observers
    value: FloatArray | None = None
