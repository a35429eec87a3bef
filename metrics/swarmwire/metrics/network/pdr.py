"""Packet delivery ratios of the last while: of all intended receivers, and of those in range."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.packets import Fate
from swarmwire.comms.truth import PacketCounts, Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.network.windowed import OfWindow, Window


class _DeliveryRatio(OfWindow):
    """Receivers that received / a count of receivers, of the fates that became final in the window."""

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps the counts of the window's ticks."""
        window = Window(static, self.window_s, 2)

        def measure(moment: Moment) -> FloatArray | float:
            tally = moment.truth.tally
            if tally is None:
                return np.nan
            received, receivers = window.add((tally.fates[:, Fate.RECEIVED], self._receivers(tally)))
            return received / np.where(receivers > 0, receivers, np.nan)

        return measure

    def _receivers(self, tally: PacketCounts) -> IntArray:
        """The receivers that the ratio is of, (arenas,)."""
        raise NotImplementedError


@dataclass(frozen=True)
class PacketDeliveryRatio(_DeliveryRatio):
    """Receivers that received / intended receivers, of the fates that became final in the last `window_s`.

    Every fate counts, so receivers out of range lower the ratio. `link_pdr` counts only receivers in range. A loss
    becomes final sooner than a reception, by the radio's latency, so the ratio dips as traffic sets in and rises as it
    ends. The ratio over the whole run is `radio.pdr` of the summary; the mean of this metric over the ticks differs,
    since each tick has the same weight, however many packets it has. From 0 to 1; NaN without a radio, or if no fate
    became final in the window.
    """

    name = "pdr"
    help = "packet delivery ratio: received / intended receivers, of the fates that became final in the last window_s"
    bounds = (0.0, 1.0)

    def _receivers(self, tally: PacketCounts) -> IntArray:
        return tally.fates.sum(axis=1)


@dataclass(frozen=True)
class LinkPacketDeliveryRatio(_DeliveryRatio):
    """Receivers that received / receivers in range, of the fates that became final in the last `window_s`.

    In range after path loss and walls, as in `PacketCounts.in_range`: dead and blacked-out receivers count. With
    independent losses of probability p the ratio is 1 - p, with K tries 1 - p^K. A loss becomes final sooner than a
    reception, by the radio's latency, so the ratio dips as traffic sets in and rises as it ends. The ratio over the
    whole run is `radio.link_pdr` of the summary; the mean of this metric over the ticks differs, since each tick has
    the same weight, however many packets it has. From 0 to 1; NaN without a radio, or if no fate of a receiver in
    range became final in the window.
    """

    name = "link_pdr"
    help = "delivery ratio of links: received / in range, of the fates that became final in the last window_s"
    bounds = (0.0, 1.0)

    def _receivers(self, tally: PacketCounts) -> IntArray:
        return tally.in_range
