"""Blackout: radios neither send nor receive."""

from dataclasses import dataclass

from swarmwire.comms.air.disruption import BACKLOGS
from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.events.conditions import Conditions, alone
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Swarm
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

    def hold(self, serial: int, swarm: Swarm, conditions: Conditions) -> None:
        """Hold the radios off."""
        conditions.backlogs[serial] = BACKLOGS.index(self.backlog)
        conditions.blackouts[serial] = self.robots.rows(serial, swarm, conditions.alive)

    def changed(self, serial: int, conditions: Conditions) -> BoolArray:
        """Those whose radios nothing else holds off."""
        return alone(serial, conditions.blackouts)
