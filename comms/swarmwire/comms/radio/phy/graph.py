"""The radio graph of the PHY: pairs of robots between which lone packets get through, without fast fading.

Jammers and losses count; carrier sense does not.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from collections.abc import Callable

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.model import edges_above, is_enough
from swarmwire.comms.radio.phy.jamming import JammerTable
from swarmwire.comms.radio.phy.link_table import LinkTable
from swarmwire.comms.radio.phy.pairs import Pairs
from swarmwire.comms.radio.phy.params import PhyParams
from swarmwire.comms.radio.phy.success import lone_deliveries, lone_delivery
from swarmwire.comms.radio.stages.losses import LossChain

NEGLIGIBLE_POWER_RATIO = 1e-3  # power of a jammer / noise power


class RadioGraph:
    """Computes the edges from the link table under the current poses."""

    def __init__(
        self, context: ChannelContext, params: PhyParams, links: LinkTable, jam: JammerTable, losses: LossChain
    ) -> None:
        self._disruption, self._links, self._jam, self._losses = context.disruption, links, jam, losses
        self.tune(context.radio, params)

    def tune(self, radio: Radio, params: PhyParams) -> None:
        """Use these parameters from now on; tune the losses first."""
        self._params, self._bits = params, 8 * (radio.max_payload_bytes + radio.overhead_bytes)
        passing = self._losses.passing
        # Least delivery without the losses that are equal on all links, so that a comparison of powers is sufficient.
        self._min_delivery = (
            radio.min_delivery / passing if passing > 0.0 else math.inf if radio.min_delivery > 0.0 else 0.0
        )
        self._min_dbm = min_power_where(
            lambda dbm: bool(is_enough(lone_delivery(params, dbm, self._bits), self._min_delivery))
        )

    def edges(self, pose: FloatArray, alive: BoolArray, at_ns: int) -> IntArray:
        """Return the edges, robot rows a < b, with the robots at `pose` (rows, 4); sorted, (e, 2).

        Measured values are those at `at_ns`.
        """
        links, rows, disruption = self._links, len(pose), self._disruption
        is_current = pose is links.pose or np.array_equal(pose, links.pose)
        pairs = links.pairs if is_current else links.pairs_at(pose)
        by_power = not (self._jam.anything or self._losses.varies)
        send_dbm, receive_dbi = links.propagation.send_dbm, links.propagation.receive_dbi
        min_dbm = self._min_dbm if by_power else -math.inf
        candidates = _above(pairs, alive, send_dbm, receive_dbi, min_dbm)
        if disruption.is_active:
            candidates = candidates[disruption.connects(pairs.a[candidates], pairs.b[candidates])]
        key = pairs.a[candidates] * rows + pairs.b[candidates]
        if by_power:
            key.sort()
            return _ends(key, rows)
        order = np.argsort(key)
        delivery = self._delivery(pairs, at_ns)[candidates][order]
        return edges_above(_ends(key[order], rows), delivery, self._min_delivery)

    def _delivery(self, pairs: Pairs, at_ns: int) -> FloatArray:
        """Return the delivery of each pair in the worse direction, without losses that are equal on all links, (k,).

        A packet meets all continuous jammers, and either none or all of the pulsed ones.
        """
        noise_mw = self._params.noise_mw
        steady_mw, all_mw, clear = self._jam.by_robot(NEGLIGIBLE_POWER_RATIO * noise_mw)
        steady_db, all_db = (
            10.0 * portable.log10(1.0 + steady_mw / noise_mw),
            10.0 * portable.log10(1.0 + all_mw / noise_mw),
        )
        worse = np.full(len(pairs.a), np.inf)
        directions = (pairs.a, pairs.b), (pairs.b, pairs.a)
        for mean_dbm, (sender, receiver) in zip(self._links.mean_dbm(pairs), directions, strict=True):
            lone = lone_deliveries(self._params, mean_dbm - steady_db[receiver], self._bits)
            jammed = lone_deliveries(self._params, mean_dbm - all_db[receiver], self._bits)
            delivery = clear[receiver] * lone + (1.0 - clear[receiver]) * jammed
            worse = np.minimum(worse, delivery * self._losses.delivery(sender, receiver, at_ns))
        return worse


@njit(nogil=True)
def _above(pairs, alive, send_dbm, receive_dbi, min_dbm):
    """Return the pairs of robots `alive` (rows,) that nothing blocks, with `min_dbm` in both directions, (k,)."""
    index, count = np.empty(len(pairs.a), np.int64), 0
    for i in range(len(index)):
        a, b = np.uint64(pairs.a[i]), np.uint64(pairs.b[i])
        forward_dbm = send_dbm[a] + receive_dbi[b] - pairs.loss_db[i]
        reverse_dbm = send_dbm[b] + receive_dbi[a] - pairs.reverse_db[i]
        # Branchless: write first, then advance for a pair that counts.
        index[count] = i
        count += alive[a] & alive[b] & (not pairs.blocked[i]) & (min(forward_dbm, reverse_dbm) >= min_dbm)
    return index[:count]


@njit()
def _ends(key, rows):
    """Return the robot rows (k, 2) of keys a x rows + b."""
    ends = np.empty((len(key), 2), np.int64)
    for i in range(len(key)):
        ends[i, 0] = key[i] // rows
        ends[i, 1] = key[i] - ends[i, 0] * rows
    return ends


def min_power_where(is_enough: Callable[[float], bool]) -> float:
    """Return the lowest power in dBm, to the last bit, at which the monotone `is_enough` is true; inf if none."""
    low_dbm, high_dbm = -300.0, 300.0
    if is_enough(low_dbm) or not is_enough(high_dbm):
        return -math.inf if is_enough(low_dbm) else math.inf
    while low_dbm < (middle_dbm := 0.5 * (low_dbm + high_dbm)) < high_dbm:
        low_dbm, high_dbm = (low_dbm, middle_dbm) if is_enough(middle_dbm) else (middle_dbm, high_dbm)
    return high_dbm
