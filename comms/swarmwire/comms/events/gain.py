"""Gain: antennas that send or hear better or worse than they should."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.selection import Selection
from swarmwire.comms.events.swarm import Groups, Swarm
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class Gain(LastingEvent):
    """The antennas of robots gain or lose, for what they send and what they hear each for itself; gains add up.

    A robot whose `receive_db` alone has fallen is heard as before, but hears less: links differ by their direction.
    """

    do: str = parameter("gain", help="antennas send or hear better or worse", choices=("gain",))
    robots: Selection = parameter(help="whose antennas; share and count choose among robots alive")
    send_db: float = parameter(
        0.0, help="added to the strength of all that they send", unit="dB", at_least=-200, at_most=100
    )
    receive_db: float = parameter(
        0.0, help="added to the strength of all that they hear", unit="dB", at_least=-200, at_most=100
    )
    needs_radio = needs_signals = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput for robots that there are not, or if nothing would change."""
        super().check(groups)
        if self.send_db == 0.0 and self.receive_db == 0.0:
            raise BadInput("", "", "expected send_db or receive_db")

    def hold(self, serial: int, swarm: Swarm, conditions: Conditions) -> None:
        """Change the antennas."""
        chosen = self.robots.rows(serial, swarm, conditions.alive)
        conditions.gains[serial] = np.where(chosen, np.array([[self.send_db], [self.receive_db]]), 0.0)

    def changed(self, serial: int, conditions: Conditions) -> BoolArray:
        """All that were chosen."""
        return (conditions.gains[serial] != 0.0).any(axis=0)
