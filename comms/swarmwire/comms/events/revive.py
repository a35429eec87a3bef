"""Revive: robots that were killed act again, with a fresh memory."""

from dataclasses import dataclass

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.clock import to_ns
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import Event
from swarmwire.comms.events.failing import BATTERY
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Swarm
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class Revive(Event):
    """Whatever killed them, the robots are alive again; those that are so already do not notice.

    One whose battery was empty gets a full one.
    """

    do: str = parameter("revive", help="robots that were killed act again", choices=("revive",))
    robots: Selection = parameter(help="which robots; share and count choose among those dead")

    def begin(self, serial: int, swarm: Swarm, conditions: Conditions) -> BoolArray:
        """Free the robots of every kill; changed are those that were dead."""
        dead = ~conditions.alive
        chosen = self.robots.rows(serial, swarm, dead)
        for held in conditions.kills.values():
            held[chosen] = False
        for failing in conditions.failures.values():
            if failing.part == BATTERY:
                failing.renew(chosen, to_ns(self.at_s))
        return chosen & dead
