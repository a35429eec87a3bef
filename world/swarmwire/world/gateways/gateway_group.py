"""One group of robots and its gateway: rows of the loop on one side, places in the group on the other."""

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.tick_io import Actions, LedChanges, Senses
from swarmwire.comms.truth import Group
from swarmwire.world.gateways.gateway import Gateway


class GatewayGroup:
    """The robots of a group of a run's only arena, behind a gateway.

    Attributes:
        name: of the group.
        kind: of the gateway.
        rows: (n,) robot rows.
        gateway: where they answer.
        driven: (n,) bool, which of them some program has told how to move.
    """

    def __init__(self, group: Group, kind: str, gateway: Gateway) -> None:
        self.name, self.kind, self.gateway = group.name, kind, gateway
        self.rows = np.arange(group.start, group.stop)
        self.driven = np.zeros(len(self.rows), np.bool_)
        self._alive = self._minds = np.ones(len(self.rows), np.bool_)
        self._told: dict[str, FloatArray] = {}  # the newest readings, of the dead those before their death

    def publish(self, time_ns: int, senses: Senses) -> None:
        """Hand the newest readings to the gateway; who senses nothing in a tick in which its group acts is dead."""
        if self.name not in senses:  # it does not act in this tick
            return
        own = senses[self.name]
        place = own.rows - self.rows[0]
        alive = np.zeros(len(self.rows), np.bool_)
        alive[place] = True
        # One that dies or is revived comes to rest by itself, which no program told it.
        self._minds, self._alive = alive & self._alive, alive
        self._told = {field: self._whole(field, place, column) for field, column in own.fields.items()}
        self.gateway.publish(time_ns, self._told, alive)

    def take(self) -> Actions:
        """What foreign programs told the robots since it was asked last."""
        told = self.gateway.take()
        self.driven |= told.drive & self._minds
        leds = LedChanges(told.leds.rows + self.rows[0], told.leds.which, told.leds.rgb)
        return Actions(self.rows, told.drive, told.linear_mps, told.angular_radps, told.lateral_mps, leds=leds)

    def _whole(self, field: str, place: IntArray, column: FloatArray) -> FloatArray:
        """A row for each robot, also the dead: a new array, since the gateway may still read the last one."""
        if len(place) == len(self.rows):
            return column
        whole = self._told[field].copy() if field in self._told else np.zeros((len(self.rows), *column.shape[1:]))
        whole[place] = column
        return whole
