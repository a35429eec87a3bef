"""Gain: antennas that send or hear better or worse than they should."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.kill import check_robots
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
    needs_radio = True

    def check(self, groups: Groups) -> None:
        """Raise BadInput for robots that there are not, or if nothing would change."""
        check_robots(self.robots, groups)
        if self.send_db == 0.0 and self.receive_db == 0.0:
            raise BadInput("", "", "expected send_db or receive_db")

    def check_radio(self, radio: Radio) -> None:
        """Raise BadInput for a disk."""
        refuse_disk(self.do, radio)

    def begin(self, serial: int, swarm: Swarm, conditions: Conditions) -> BoolArray:
        """Change the antennas; changed are all that were chosen."""
        chosen = self.robots.rows(serial, swarm, conditions.alive)
        conditions.gains[serial] = np.where(chosen, np.array([[self.send_db], [self.receive_db]]), 0.0)
        return chosen

    def end(self, serial: int, conditions: Conditions) -> BoolArray:
        """Change them back."""
        send_db, receive_db = conditions.gains.pop(serial)
        return (send_db != 0.0) | (receive_db != 0.0)


def refuse_disk(do: str, radio: Radio) -> None:
    """Raise BadInput, with the key `do`, unless the radio's signals have a strength."""
    if not radio.is_signal:
        raise BadInput("", "do", f"expected a radio with signals for {do!r}: a disk knows no strength")
