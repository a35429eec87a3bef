"""What a stage of the channel is, and what it may know."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from swarmwire.comms.arrays import BoolArray, FloatArray, KeyArray
from swarmwire.comms.geometry.obstacles import Obstacles
from swarmwire.comms.radio.config.phy import Antennas
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.traces import LinkTraces


@dataclass(frozen=True, slots=True)
class ChannelContext:
    """What stages are made from."""

    radio: Radio
    keys: KeyArray  # (arenas,) for draws
    robots: int  # in each arena
    obstacles: Obstacles
    size_m: tuple[float, float]  # of each arena
    radius_m: FloatArray  # (rows,) of the robots
    disruption: Disruption  # kept up to date by the medium
    antennas: Antennas  # of robots
    running: BoolArray  # (arenas,) kept up to date by the medium: in others nobody sends any more
    traces: LinkTraces | None = None  # of the radio's trace, where it has one
    is_torus: bool = False  # distances are the shortest

    @property
    def wrap_m(self) -> tuple[float, float]:
        """The sides over which a torus goes on, in m; 0 where an arena ends, as `geometry.to_nearest` takes them."""
        return self.size_m if self.is_torus else (0.0, 0.0)


class Stage(ABC):
    """One step in the life of a packet between the sender's radio and one receiver."""

    name: ClassVar[str]  # as `swarmwire describe` has it
    keys: ClassVar[tuple[str, ...]]  # of [radio] that it goes by
    remembers = False  # whether packets that never go on air must not be shown to it

    @classmethod
    @abstractmethod
    def of(cls, context: ChannelContext) -> "Stage | None":
        """The stage of this medium; None where it has none."""

    @abstractmethod
    def decide(self, links: Links, pose: FloatArray) -> None:
        """Give a fate to links that end here, or change what becomes of the others; in place.

        Only links with fate RECEIVED are still under way. `pose` (rows, 3) is that at `on_air_at_ns`: x, y in m,
        heading. A stage before reception that ends a link also sets its `in_range` to 0.
        """

    def go_on_from(self, before: "Stage", at_ns: int) -> None:  # noqa: B027 - most stages remember nothing
        """Remember what a stage of the same kind did, whose radio had other numbers until `at_ns`."""

    @property
    def lets_all_pass(self) -> bool:
        """Whether `delivery` would be 1 for everybody at the moment: then it is not asked."""
        return False

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray | float:
        """With which probability lone packets pass, fast fading apart, (k,) or one for all: for the radio graph.

        The worse direction counts. `final_at_ns` is the time for which the graph is.
        """
        return 1.0
