"""The surroundings of a radio channel: the radio, the arenas and the robots, as input of models and stages."""

from dataclasses import dataclass, field

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, KeyArray
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.geometry.obstacles import Obstacles, obstacle_arrays
from swarmwire.comms.base.threads import Threads
from swarmwire.comms.radio.config.antennas import Antennas
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import ActiveDisruption
from swarmwire.comms.radio.traces import NO_VALUES, LinkTraces, TraceValues


def in_space(pose: FloatArray) -> FloatArray:
    """Return poses (rows, 4), x, y, heading and height, of poses (rows, 3) or (rows, 4); without heights they are 0."""
    if pose.shape[1] == 3:
        pose = np.column_stack([pose, np.zeros(len(pose))])
    return np.ascontiguousarray(pose)  # one layout: kernels are compiled once


@dataclass(frozen=True, slots=True)
class ChannelContext:
    """The radio, the arenas and the robots of one medium; robot row r is robot r % robots of arena r // robots.

    The medium changes `disruption` and `running` in place, so a context serves one medium.
    """

    radio: Radio
    keys: KeyArray  # (arenas,) keys of draws
    robots: int  # robots per arena
    size_m: tuple[float, float]  # sides of an arena
    obstacles: ObstacleIndices  # without periodic images
    radius_m: FloatArray  # (rows,) radii of the robots; 0: no body
    height_m: FloatArray  # (rows,) heights of their bodies
    antennas: Antennas  # antennas of the robots of an arena
    disruption: ActiveDisruption
    running: BoolArray  # (arenas,) False: the arena has ended
    stations: tuple[int, ...] = (0,)  # access "esb": indices in the arena of the robots that poll
    traces: LinkTraces | None = None  # content of the radio's trace file
    is_torus: bool = False  # opposite sides of an arena meet: shortest distances count
    threads: Threads = field(default_factory=Threads)

    @classmethod
    def open_space(
        cls,
        radio: Radio,
        keys: KeyArray,
        robots: int,
        size_m: tuple[float, float],
        obstacles: Obstacles | None = None,
        *,
        obstacles_move: bool = False,
    ) -> "ChannelContext":
        """Return the context of robots without bodies and with equal antennas, in arenas with walls.

        With `obstacles_move` the arrays of `obstacles` may change in place.
        """
        arenas, rows = len(keys), len(keys) * robots
        arrays = obstacle_arrays(((),) * arenas) if obstacles is None else obstacles
        return cls(
            radio,
            keys,
            robots,
            size_m,
            ObstacleIndices(arrays, size_m, 0.0, obstacles_move=obstacles_move),
            np.zeros(rows),
            np.full(rows, np.inf),
            Antennas.alike(robots),
            ActiveDisruption.none(rows),
            np.ones(arenas, np.bool_),
        )

    @property
    def rows(self) -> int:
        """Number of robots of all arenas."""
        return len(self.keys) * self.robots

    @property
    def wrap_m(self) -> tuple[float, float]:
        """Sides of a torus in m, for `geometry.obstacles.to_nearest`; 0 in arenas with walls."""
        return self.size_m if self.is_torus else (0.0, 0.0)

    @property
    def measured(self) -> TraceValues:
        """Measured values of links as input of kernels; none without a trace."""
        return NO_VALUES if self.traces is None else self.traces.values
