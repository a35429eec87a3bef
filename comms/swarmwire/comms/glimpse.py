"""A run as those see it who look on from another process: some of its ticks, and the numbers measured so far."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static, Truth


@dataclass(frozen=True, slots=True)
class Series:
    """A metric whose values come with each glimpse."""

    name: str
    unit: str
    bounds: tuple[float | None, float | None]  # least and largest value of a tick; None: there is none


@dataclass(frozen=True, slots=True)
class Scene:
    """What a run tells once to whoever begins to look on."""

    static: Static
    series: tuple[Series, ...]
    selected: str  # the robot that is shown in detail


@dataclass(frozen=True, slots=True)
class Glimpse:
    """One tick, with what happened in the ticks since the glimpse before.

    `truth` is the state of its tick; its contact onsets, tally and events are those of the last `ticks` ticks together.
    Edges, finished links and senses may be left out (None, None, {}), as they are large.
    """

    truth: Truth
    serial: int  # how many glimpses went before; what is left out in between was lost on the way
    ticks: int  # at least 1
    values: FloatArray  # (series, arenas) latest value of each metric
