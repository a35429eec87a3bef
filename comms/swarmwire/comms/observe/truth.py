"""Ground truth for observers: `Static` once per run, `Truth` once per tick. Runners never get it.

`Truth` holds the state at the tick's start, the robots' actions in the tick and the records of the radio up to its
start.
"""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.floor import Floor
from swarmwire.comms.base.geometry.shapes import Boundary, Obstacle
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.tick_io import Readings


@dataclass(frozen=True, slots=True)
class Light:
    """A light of an arena, for light sensors."""

    x_m: float
    y_m: float
    intensity_m: float  #: reach of the light: ARGoS's I in exp(-2 d / I)


@dataclass(frozen=True, slots=True)
class Group:
    """Robots of one kind: indices `start` to `stop` - 1 in every arena."""

    name: str
    body: Body
    start: int
    stop: int
    act_every_ticks: int = 1  #: the robots act when the tick modulo this is 0
    followed: bool = False  #: True: a source moves the robots, not an engine


@dataclass(frozen=True, slots=True)
class Static:
    """Constant facts of a run. Robot row r is robot r % robots of arena r // robots."""

    name: str
    seeds: tuple[int, ...]  #: (arenas,) seed of each arena
    rate_hz: int
    arena_size_m: tuple[float, float]  #: full extents; the origin is the centre
    boundary: Boundary
    obstacles: tuple[tuple[Obstacle, ...], ...]  #: (arenas,) obstacles of each arena
    groups: tuple[Group, ...]
    robot_names: tuple[str, ...]  #: (robots,) name of each index in an arena
    range_m: float | None = None  #: range of the radio; None: no radio
    lights: tuple[tuple[Light, ...], ...] = ()  #: (arenas,) lights of each arena; empty: no lights
    floor: Floor | None = None  #: floor of all arenas; None: white

    @property
    def walled(self) -> bool:
        """True if walls surround each arena."""
        return self.boundary == "walls"

    @property
    def movable(self) -> int:
        """Number of obstacles in each arena that robots can push."""
        return sum(obstacle.movable for obstacle in self.obstacles[0])

    def movable_at(self, arena: int, pose: FloatArray) -> tuple[Obstacle, ...]:
        """Return the movable obstacles of an arena at poses (k, 3)."""
        movable = (obstacle for obstacle in self.obstacles[arena] if obstacle.movable)
        return tuple(obstacle.put_at(*row) for obstacle, row in zip(movable, pose.tolist(), strict=True))

    def fixed(self, arena: int) -> tuple[Obstacle, ...]:
        """Return the obstacles of an arena that robots cannot push."""
        return tuple(obstacle for obstacle in self.obstacles[arena] if not obstacle.movable)

    @property
    def arenas(self) -> int:
        """Number of arenas in the world."""
        return len(self.seeds)

    @property
    def robots(self) -> int:
        """Number of robots in each arena."""
        return len(self.robot_names)

    @property
    def any_followed(self) -> bool:
        """True if a source moves any robots."""
        return any(group.followed for group in self.groups)

    @property
    def max_leds(self) -> int:
        """Largest number of LEDs of a robot."""
        return max(group.body.led_count for group in self.groups)

    @property
    def act_every_ticks(self) -> IntArray:
        """Period of each robot index in ticks: the robot acts when the tick modulo this is 0, (robots,)."""
        return np.concatenate([np.full(group.stop - group.start, group.act_every_ticks) for group in self.groups])


BATTERY_EMPTY = "run_down"  # action of the event that batteries are empty, which is not from the scenario


@dataclass(frozen=True, slots=True)
class EventRecord:
    """An event that began in this tick, or that ended because its duration is over."""

    serial: int  #: index in the scenario, or NO_SERIAL
    at_s: float  #: time in the scenario; start of the tick if `singly`
    do: str  #: action of the scenario, or BATTERY_EMPTY
    ended: bool  #: True: the event ended in this tick
    changed: BoolArray  #: (rows,) True for the robots that the event changed
    part: str = ""  #: failing part; empty for other actions
    singly: bool = False  #: True: each robot has its own time, and arenas without a changed robot are not affected

    @property
    def words(self) -> str:
        """The event as a text: the action, its part if it has one, and "ended" if it ended."""
        return f"{self.do}{f' {self.part}' if self.part else ''}{' ended' if self.ended else ''}"

    def changed_names(self, static: Static) -> list[list[str]]:
        """Return the names of the robots that the event changed, a list per arena."""
        changed = self.changed.reshape(static.arenas, static.robots)
        return [[static.robot_names[index] for index in np.flatnonzero(mask)] for mask in changed]


@dataclass(frozen=True, slots=True)
class Truth:
    """One tick: the state at its start, the robots' actions in it, and the radio's records up to its start.

    In an arena that has left the world, no robot is alive, nothing moves, is received or happens, and the rows keep
    their last values.
    """

    tick: int
    time_ns: int
    running: BoolArray  #: (arenas,) False: the arena has left the world
    alive: BoolArray  #: (rows,)
    pose: FloatArray  #: (rows, 3) x, y in m, heading in rad, arena frame
    velocity: FloatArray  #: (rows, 3) m/s, m/s, rad/s, arena frame
    command: FloatArray  #: (rows, 3) limited by the drive: m/s ahead, rad/s to the left, m/s to the left
    state: IntArray  #: (rows,) index in `states` of the last state that the agent noted; 0: none
    states: tuple[str, ...]  #: all states noted so far, in order; the first is empty
    leds: IntArray  #: (rows, max LEDs of a robot) 0xRRGGBB after this tick's commands; 0: dark, or no LED
    readings: Readings  #: readings at the start of the tick of the robots that act in it
    contact_onsets: IntArray  #: (arenas, 2) contacts that began in this tick: between robots, with walls or obstacles
    edges: IntArray | None  #: (e, 2) robot rows joined in the radio graph at the tick's start; None without a radio
    tally: PacketCounts | None  #: None without a radio
    finished: ReceptionRecords | None  #: None without a radio
    events: tuple[EventRecord, ...] = ()  #: at the tick's start, in order
    departed: TransmissionRecords | None = None  #: None without a radio, and for live observers
    movable: FloatArray | None = None  #: (arenas, movable obstacles, 3) x, y, heading; None: no movable obstacles
    # (rows,) height in m of each robot's lower side above the floor; None for live observers, and of real robots
    height_m: FloatArray | None = None
    # (rows,) last noted value, NaN: none; None: no agent has noted a value yet, and for live observers
    value: FloatArray | None = None

    @property
    def position_m(self) -> FloatArray:
        """x, y and height of each robot, (rows, 3) in m; 0 for a height that is None."""
        height_m = np.zeros(len(self.pose)) if self.height_m is None else self.height_m
        return np.column_stack((self.pose[:, :2], height_m))
