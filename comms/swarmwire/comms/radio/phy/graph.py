"""The radio graph of signals: which robots a lone packet joins both ways, fast fading apart."""

# pyright: basic, reportUnknownMemberType=false

import math
from collections.abc import Callable

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.phy.jamming import JammerTable
from swarmwire.comms.radio.phy.link_table import LinkTable
from swarmwire.comms.radio.phy.losses import MeasuredLinks, passing_share
from swarmwire.comms.radio.phy.pairs import Pairs
from swarmwire.comms.radio.phy.params import PhyParams
from swarmwire.comms.radio.phy.reception import lone_deliveries, lone_delivery
from swarmwire.comms.radio.stages.stage import ChannelContext
from swarmwire.comms.radio.unit_disk.model import ROUNDING

NEGLIGIBLE = 1e-3  # power of a jammer over that of the noise


class RadioGraph:
    """Joins pairs of links held; jammers and measured ratios count, carrier sense does not."""

    def __init__(
        self,
        context: ChannelContext,
        rules: PhyParams,
        links: LinkTable,
        jam: JammerTable,
        measured: MeasuredLinks | None,
    ):
        self._disruption, self._links, self._jam, self._measured = context.disruption, links, jam, measured
        self.tune(context.radio, rules)

    def tune(self, radio: Radio, rules: PhyParams) -> None:
        """The radio has these numbers from now on."""
        self._rules, self._bits = rules, 8 * (radio.max_payload_bytes + radio.overhead_bytes)
        others = passing_share(radio)
        self._least = radio.min_delivery / others if others > 0.0 else math.inf if radio.min_delivery > 0.0 else 0.0
        self._least_dbm = least_where(lambda dbm: lone_delivery(rules, dbm, self._bits) >= self._least - ROUNDING)

    def edges(self, pose: FloatArray, alive: BoolArray) -> IntArray:
        """Pairs of robot rows a < b joined while robots stand at `pose` (rows, 3), sorted, (e, 2)."""
        links = self._links
        pairs = links.pairs if np.array_equal(pose, links.pose) else links.pairs_at(pose)
        joined = alive[pairs.a] & alive[pairs.b] & (pairs.blocked == 0)
        if self._disruption.anything:
            joined &= self._disruption.joined(pairs.a, pairs.b)
        if self._jam.anything or self._measured is not None:
            joined &= self._get_through(pairs)
        else:
            joined &= np.minimum(*links.mean_dbm(pairs)) >= self._least_dbm
        return np.stack(np.divmod(np.sort((pairs.a * len(pose) + pairs.b)[joined]), len(pose)), axis=1)

    def _get_through(self, pairs: Pairs) -> BoolArray:
        """Which pairs, (k,): beside jammers that never pause, a packet meets no other or all of them."""
        noise_mw = self._rules.noise_mw
        steady_mw, all_mw, clear = self._jam.by_robot(NEGLIGIBLE * noise_mw)
        steady_db, all_db = 10.0 * np.log10(1.0 + steady_mw / noise_mw), 10.0 * np.log10(1.0 + all_mw / noise_mw)
        joined = np.ones(len(pairs.a), np.bool_)
        ways = (pairs.a, pairs.b), (pairs.b, pairs.a)
        for mean_dbm, (sender, receiver) in zip(self._links.mean_dbm(pairs), ways, strict=True):
            lone = lone_deliveries(self._rules, mean_dbm - steady_db[receiver], self._bits)
            jammed = lone_deliveries(self._rules, mean_dbm - all_db[receiver], self._bits)
            delivery = clear[receiver] * lone + (1.0 - clear[receiver]) * jammed
            if self._measured is not None:
                delivery *= self._measured.ratio(sender, receiver)
            joined &= delivery >= self._least - ROUNDING
        return joined


def least_where(is_enough: Callable[[float], bool]) -> float:
    """The least power in dBm, to the last bit, that is enough, if more is never worse; inf if none is."""
    low_dbm, high_dbm = -300.0, 300.0
    if is_enough(low_dbm) or not is_enough(high_dbm):
        return -math.inf if is_enough(low_dbm) else math.inf
    while low_dbm < (middle_dbm := 0.5 * (low_dbm + high_dbm)) < high_dbm:
        low_dbm, high_dbm = (low_dbm, middle_dbm) if is_enough(middle_dbm) else (middle_dbm, high_dbm)
    return high_dbm
