"""The traces of one file: what was measured of the same links, each quantity with its own rows."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.air.traces.link_trace import LinkTrace
from swarmwire.comms.arrays import BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class LinkTraces:
    """Measured links by quantity; None: not measured at all."""

    delivery_ratio: LinkTrace | None = None
    rssi_dbm: LinkTrace | None = None
    delay_s: LinkTrace | None = None

    @property
    def all(self) -> tuple[LinkTrace, ...]:
        """Those that were measured."""
        traces = self.delivery_ratio, self.rssi_dbm, self.delay_s
        return tuple(trace for trace in traces if trace is not None)

    def known(self, sender: IntArray, receiver: IntArray, at_ns: IntArray) -> BoolArray:
        """Which links (k,), indices in the arena, have a value of any quantity at a time."""
        found = np.zeros(len(sender), np.bool_)
        for trace in self.all:
            found |= ~np.isnan(trace.at(sender, receiver, at_ns))
        return found
