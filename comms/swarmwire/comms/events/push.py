"""Push: robots get another velocity at once, as by a blow."""

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import Event
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Swarm
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class Push(Event):
    """The robots' velocity changes by so much in a direction; what follows is up to their motors, and to what they hit.

    A robot on wheels is brought back to its command's speed as fast as its motors' force allows, which may be within a
    tick; a dead one only brakes. How many newton seconds that takes is its mass times the speed. Bodies without
    contacts, which go where they are told, cannot be pushed.
    """

    do: str = parameter("push", help="robots get another velocity at once", choices=("push",))
    robots: Selection = parameter(help="which robots; share and count choose among those alive")
    speed_mps: float = parameter(help="how much is added to their velocity", unit="m/s", above=0, at_most=1000)
    direction_rad: float = parameter(
        0.0,
        help="where to, in the arena's frame: 0 along x, to the left of it above 0",
        unit="rad",
        at_least=-7,
        at_most=7,
    )

    def begin(self, serial: int, swarm: Swarm, conditions: Conditions) -> BoolArray:
        """Push them; changed are all that were chosen, dead ones too."""
        chosen = self.robots.rows(serial, swarm, conditions.alive)
        by_mps = self.speed_mps * np.array([cos(self.direction_rad), sin(self.direction_rad)])
        conditions.pushes[serial] = np.where(chosen[:, None], by_mps, 0.0)
        return chosen
