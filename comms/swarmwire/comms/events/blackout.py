"""Blackout: radios neither send nor receive."""

from dataclasses import dataclass

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.kill import check_robots
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Groups, Swarm
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class Blackout(LastingEvent):
    """The robots go on, deaf and mute, and do not know it: their queues drain at the usual pace, into nothing."""

    do: str = parameter("blackout", help="radios neither send nor receive", choices=("blackout",))
    robots: Selection = parameter(help="whose radios; share and count choose among robots alive")
    needs_radio = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput for robots that there are not."""
        check_robots(self.robots, groups)

    def begin(self, serial: int, swarm: Swarm, conditions: Conditions) -> BoolArray:
        """Hold the radios off; changed are those that were on."""
        on = conditions.radio_on
        conditions.blackouts[serial] = self.robots.rows(serial, swarm, conditions.alive)
        return on & ~conditions.radio_on

    def end(self, serial: int, conditions: Conditions) -> BoolArray:
        """Let go of the radios; changed are those that nothing else holds off."""
        off = ~conditions.radio_on
        del conditions.blackouts[serial]
        return off & conditions.radio_on
