"""Ramp: a number of the radio moves to another value."""

from dataclasses import dataclass, replace

import numpy as np

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.radio_checks import check_radio
from swarmwire.comms.air.tuning import Slope, check_number, radio_at
from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.clock import to_ns
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import LastingEvent
from swarmwire.comms.events.swarm import Swarm
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class Ramp(LastingEvent):
    """A number of `[radio]` moves evenly to `to`, tick by tick, and stays there; undone, it is at once what it was.

    Any number that the scenario or its preset gives, but `send_offset`, which holds for the whole run; groups' own
    power and gain stay, and bursts given by steps move by `bad_s` and `good_s`. Packets that wait or are on air stay
    so; airtime and limits are those of the moment at which a packet is handed over. A ramp sets out from what those
    before it have made of the number.
    """

    do: str = parameter("ramp", help="a number of the radio moves to another value", choices=("ramp",))
    what: str = parameter(help='the key of the number, such as "radio.loss" or "radio.bursts.bad_s"')
    to: float = parameter(
        help="where it ends, in the key's own unit and bounds; rounded on the way if it must be whole"
    )
    over_s: float = parameter(0.0, help="how long it takes; 0: it steps", unit="s", at_least=0, at_most=1e9)
    needs_radio = True

    def check_radio(self, radio: Radio) -> None:
        """Raise BadInput for what is no number of this radio, or a value that contradicts its other keys."""
        check_number(radio, self.what, self.to)
        slope = replace(self._slope(), start_ns=0)
        # Some keys take only certain values, which may lie at the end of the way but not along it.
        for key, at_ns in (("to", slope.lasts_ns), ("over_s", slope.lasts_ns // 2)):
            try:
                check_radio(radio_at(radio, [slope], at_ns), "")
            except BadInput as error:
                raise BadInput("", key, f"{error.key}: {error.expected}") from None

    def hold(self, serial: int, swarm: Swarm, conditions: Conditions) -> None:
        """Let the number move; without it, it is at once what it was."""
        conditions.slopes[serial] = self._slope()

    def changed(self, serial: int, conditions: Conditions) -> BoolArray:
        """All robots."""
        return np.ones(conditions.rows, np.bool_)

    def _slope(self) -> Slope:
        return Slope(self.what, self.to, to_ns(self.at_s), to_ns(self.over_s))
