"""Kill: robots stop where they stand, and are obstacles from then on."""

from dataclasses import dataclass

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.events.conditions import Conditions, alone
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Swarm
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class Kill(LastingEvent):
    """A killed robot brakes, no longer acts, and its radio forgets its queue; undone, it is revived."""

    do: str = parameter("kill", help="robots stop where they stand", choices=("kill",))
    robots: Selection = parameter(help="which robots; share and count choose among those alive")

    def hold(self, serial: int, swarm: Swarm, conditions: Conditions) -> None:
        """Hold the robots dead."""
        conditions.kills[serial] = self.robots.rows(serial, swarm, conditions.alive)

    def changed(self, serial: int, conditions: Conditions) -> BoolArray:
        """Those that nothing else holds dead."""
        return alone(serial, conditions.kills)
