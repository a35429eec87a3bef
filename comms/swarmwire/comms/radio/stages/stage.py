"""The interface of a channel stage, and the context from which stages are made."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

from swarmwire.comms.base.arrays import BoolArray, FloatArray, KeyArray
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.threads import Threads
from swarmwire.comms.radio.config.phy import Antennas
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.traces import LinkTraces


@dataclass(frozen=True, slots=True)
class ChannelContext:
    """The radio, the arenas and the robots, as input of all stages."""

    radio: Radio
    keys: KeyArray  # (arenas,) for draws
    robots: int  # in each arena
    obstacles: ObstacleIndices  # without images
    size_m: tuple[float, float]  # of each arena
    radius_m: FloatArray  # (rows,) of the robots
    disruption: Disruption  # kept up to date by the medium
    antennas: Antennas  # of robots
    running: BoolArray  # (arenas,) kept up to date by the medium; other arenas have left the run
    traces: LinkTraces | None = None  # of the radio's trace, where it has one
    is_torus: bool = False  # shortest distances count
    threads: Threads = field(default_factory=Threads)

    @property
    def wrap_m(self) -> tuple[float, float]:
        """Sides of a torus in m, for `geometry.obstacles.to_nearest`; 0 where an arena has walls."""
        return self.size_m if self.is_torus else (0.0, 0.0)


class Stage(ABC):
    """One step of a packet on its way from the sender's radio to one receiver; for a loss see `LossModel`."""

    name: ClassVar[str]  # as in `swarmwire describe`
    keys: ClassVar[tuple[str, ...]]  # keys of [radio] that it uses

    @classmethod
    @abstractmethod
    def of(cls, context: ChannelContext) -> "Stage | None":
        """The stage for this medium; None where it is not needed."""

    @abstractmethod
    def decide(self, links: Links, pose: FloatArray) -> None:
        """Set the fate of links that end here, or change columns of the others; in place.

        A stage before reception works on links that are UNDER_WAY, one after it on links that are RECEIVED. One that
        ends a link before reception also sets its `in_range` to 0. `pose` (rows, 3) is that at `on_air_at_ns`: x, y in
        m, heading in rad.
        """

    def count_in_range(self, links: Links, pose: FloatArray) -> None:
        """As `decide`, for packets that never go on air: only `in_range` counts, and no state changes."""
        self.decide(links, pose)

    def go_on_from(self, previous: "Stage", at_ns: int) -> None:  # noqa: B027 - most stages have no state
        """Take over the state of the same stage with the radio parameters valid until `at_ns`."""

    @property
    def lets_all_pass(self) -> bool:
        """Whether `delivery` is 1 for all links at the moment: it is then not called."""
        return False

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray | float:
        """Probability that lone packets pass, without fast fading, (k,) or one for all: for the radio graph.

        The worse direction counts. `final_at_ns` is the time of the graph.
        """
        return 1.0
