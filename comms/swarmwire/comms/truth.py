"""Ground truth for observers: `Static` once, `Truth` per tick. It never crosses to a runner."""

from dataclasses import dataclass

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.body import Body


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A fixed thing that bodies hit and rays end at; a cylinder has radius_m, a box size_m."""

    shape: str  # "cylinder" | "box"
    x_m: float
    y_m: float
    heading_rad: float = 0.0
    radius_m: float = 0.0
    size_m: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Light:
    """A light that bodies may sense."""

    x_m: float
    y_m: float
    intensity_m: float  # reach of its glow: ARGoS's I, in exp(-2 d / I)


@dataclass(frozen=True, slots=True)
class Group:
    """Robots of one kind: indices start to stop - 1 within every arena."""

    name: str
    body: Body
    start: int
    stop: int


@dataclass(frozen=True, slots=True)
class Static:
    """What does not change during a run. Robot row r is robot r % robots of arena r // robots."""

    name: str
    seeds: tuple[int, ...]  # of each arena
    rate_hz: int
    arena_size_m: tuple[float, float]  # full extents; the origin is the centre
    walled: bool
    obstacles: tuple[tuple[Obstacle, ...], ...]  # of each arena
    groups: tuple[Group, ...]
    robot_names: tuple[str, ...]  # of each index within an arena
    range_m: float | None = None  # of the radio, where there is one
    lights: tuple[tuple[Light, ...], ...] = ()  # of each arena

    @property
    def arenas(self) -> int:
        """How many arenas the world holds."""
        return len(self.seeds)

    @property
    def robots(self) -> int:
        """Robots in each arena."""
        return len(self.robot_names)


@dataclass(frozen=True, slots=True)
class Finished:
    """Links whose fate became final since the last tick: a row per (packet, receiver it might have reached).

    Receivers out of range or behind a sender-side fate are counted in the tally alone, never listed.
    """

    arena: IntArray  # (k,)
    sender: IntArray  # (k,) index in the arena
    receiver: IntArray  # (k,) index in the arena
    sequence: IntArray  # (k,)
    sent_at_ns: IntArray  # (k,)
    on_air_at_ns: IntArray  # (k,)
    final_at_ns: IntArray  # (k,) when it was heard, or when the reception ended in another way
    fate: IntArray  # (k,) a Fate
    size_bytes: IntArray  # (k,) payload with its tag
    tag: IntArray  # (k,) topic


@dataclass(frozen=True, slots=True)
class Tally:
    """Packets counted since the last tick, a row per arena. Over a run the fates add up to the intended receivers."""

    sent: IntArray  # (arenas,) packets handed to the radio
    intended: IntArray  # (arenas,) receivers that these packets were meant for
    in_range: IntArray  # (arenas,) receivers in range after path loss and walls, of fates that became final
    fates: IntArray  # (arenas, fates) fates that became final


@dataclass(frozen=True, slots=True)
class Happened:
    """An event that began in this tick, or one that ended after its time."""

    serial: int  # its place in the scenario
    at_s: float  # when the scenario lets it begin
    do: str  # the action
    ended: bool
    changed: BoolArray  # (rows,) the robots for which it made a difference


@dataclass(frozen=True, slots=True)
class Truth:
    """One tick: the state at its start, what the robots did in it, and what came of the radio up to its start."""

    tick: int
    time_ns: int
    alive: BoolArray  # (rows,)
    pose: FloatArray  # (rows, 3) x, y in m, heading in rad, arena frame
    velocity: FloatArray  # (rows, 3) m/s, m/s, rad/s, arena frame
    command: FloatArray  # (rows, 2) applied: forward m/s, left turn rad/s
    contact_onsets: IntArray  # (arenas, 2) that began in this tick: robot with robot, robot with wall or obstacle
    edges: IntArray | None  # (e, 2) robot rows joined in the radio graph at the tick's start; None without a radio
    tally: Tally | None  # None without a radio
    finished: Finished | None  # None without a radio
    events: tuple[Happened, ...] = ()  # at the tick's start, in order
