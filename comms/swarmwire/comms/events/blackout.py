"""Blackout: radios neither send nor receive."""

from dataclasses import dataclass

from swarmwire.comms.air.disruption import BACKLOGS
from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.kill import check_robots
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Groups, Swarm
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class Blackout(LastingEvent):
    """The robots go on, deaf and mute, and do not know it.

    What they send meanwhile ends, unless `backlog` has it wait until the radio is on again: then it goes on air, packet
    after packet. Where blackouts overlap, the strictest backlog counts.
    """

    do: str = parameter("blackout", help="radios neither send nor receive", choices=("blackout",))
    robots: Selection = parameter(help="whose radios; share and count choose among robots alive")
    backlog: str = parameter(
        "drop",
        help="packets meanwhile: end at the usual pace, only the newest waits, or all do up to queue_limit",
        choices=BACKLOGS,
    )
    needs_radio = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput for robots that there are not."""
        check_robots(self.robots, groups)

    def begin(self, serial: int, swarm: Swarm, conditions: Conditions) -> BoolArray:
        """Hold the radios off; changed are those that were on."""
        on = conditions.radio_on
        conditions.backlogs[serial] = BACKLOGS.index(self.backlog)
        conditions.blackouts[serial] = self.robots.rows(serial, swarm, conditions.alive)
        return on & ~conditions.radio_on

    def end(self, serial: int, conditions: Conditions) -> BoolArray:
        """Let go of the radios; changed are those that nothing else holds off."""
        off = ~conditions.radio_on
        del conditions.blackouts[serial], conditions.backlogs[serial]
        return off & conditions.radio_on
