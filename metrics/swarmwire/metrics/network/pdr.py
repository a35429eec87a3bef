"""Packet delivery ratio: which share of the packets that could be received were, of late."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.packets import Fate
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.network.windowed import OfWindow, Window


@dataclass(frozen=True)
class PacketDeliveryRatio(OfWindow):
    """Receivers that received / receivers in range, of the fates that became final in the last `window_s`.

    In range after path loss and walls, as `Tally.in_range` says: dead and blacked-out receivers are, too. With
    independent losses of probability p it is 1 - p, with K tries 1 - p^K. A loss is final sooner than a reception, by
    the radio's latency, so the ratio dips as traffic sets in, and rises as it ends. The ratio over the whole run stands
    in the summary's `radio`, as `pdr`: the mean of this over the ticks is not it, since ticks with many packets weigh
    no more. From 0 to 1; NaN without a radio, or if no fate of a receiver in range became final in the window.
    """

    name = "pdr"
    help = "packet delivery ratio: received / in range, of the fates that became final in the last window_s"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps the counts of the window's ticks."""
        window = Window(static, self.window_s, 2)

        def measure(moment: Moment) -> FloatArray | float:
            tally = moment.truth.tally
            if tally is None:
                return np.nan
            received, in_range = window.add((tally.fates[:, Fate.RECEIVED], tally.in_range))
            return received / np.where(in_range > 0, in_range, np.nan)

        return measure
