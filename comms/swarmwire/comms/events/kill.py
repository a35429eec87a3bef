"""Kill: robots stop where they stand, and are obstacles from then on."""

from dataclasses import dataclass

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import LastingEvent, within
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Groups, Swarm
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class Kill(LastingEvent):
    """A killed robot brakes, no longer acts, and its radio forgets its queue; undone, it is revived."""

    do: str = parameter("kill", help="robots stop where they stand", choices=("kill",))
    robots: Selection = parameter(help="which robots; share and count choose among those alive")

    def check(self, groups: Groups) -> None:
        """Raise BadInput for robots that there are not."""
        check_robots(self.robots, groups)

    def begin(self, serial: int, swarm: Swarm, conditions: Conditions) -> BoolArray:
        """Hold the robots dead; changed are those that were alive."""
        alive = conditions.alive
        conditions.kills[serial] = self.robots.rows(serial, swarm, alive)
        return alive & ~conditions.alive

    def end(self, serial: int, conditions: Conditions) -> BoolArray:
        """Let go of the robots; changed are those that nothing else holds dead."""
        dead = ~conditions.alive
        del conditions.kills[serial]
        return dead & conditions.alive


def check_robots(robots: Selection, groups: Groups) -> None:
    """Raise the fault of a selection under the key `robots`."""
    with within("robots"):
        robots.check(groups)
