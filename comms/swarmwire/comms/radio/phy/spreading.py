"""Spreading factors of LoRa robots, where groups have their own.

Powers at a robot are scaled to the noise of the radio's spreading factor, so that one noise and one sensitivity hold
for all. A frame of another spreading factor is interference only, weaker by the co-channel rejection.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import replace

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, Table
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.config.lora import CAPTURE_DB, MIN_SIR_DB, SPREADING_FACTORS, Lora
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext


class Spreading:
    """The spreading factor of each robot row.

    Attributes:
        factor: the spreading factors, (rows,).
        gain_db: despreading gain against that of the radio's spreading factor, (rows,).
        lead_ns: `Lora.lead_ns` of each robot of an arena, (robots,).
    """

    def __init__(self, lora: Lora, factor: IntArray, arenas: int, largest_bytes: int) -> None:
        """`factor` (robots,) are those of an arena; frames have up to `largest_bytes`."""
        kinds = [replace(lora, spreading_factor=value) for value in SPREADING_FACTORS]
        index = factor - SPREADING_FACTORS[0]
        self.factor, self._index = np.tile(factor, arenas), np.tile(index, arenas)
        gain_db = np.array([kind.despreading_db - lora.despreading_db for kind in kinds])
        self.gain_db: FloatArray = gain_db[self._index]
        self.lead_ns: IntArray = np.array([kind.lead_ns for kind in kinds])[index]
        self._airtime_ns = np.array([kind.airtime_ns(np.arange(largest_bytes + 1)) for kind in kinds])
        self._rejection = portable.power(10.0, 0.1 * (np.array(MIN_SIR_DB) - CAPTURE_DB))

    def set_airtimes(self, packet: Table) -> None:
        """Set the airtime of packets in a table of dtype PACKET."""
        packet["airtime_ns"] = self._airtime_ns[self._index[packet["sender"]], packet["bits"] // 8]

    def separate(self, kind, power_mw, counts, a, b, fate, interferes: bool) -> None:
        """Weaken the links between different spreading factors, which become weak or omitted; see `links_by_sender`."""
        _separate(kind, power_mw, counts, a, b, fate, interferes, self._index, self._rejection)

    def are_equal(self, a: IntArray, b: IntArray) -> BoolArray:
        """Return True for pairs of robot rows (k,) that can receive each other."""
        return self.factor[a] == self.factor[b]


def spreading_of(radio: Radio, context: ChannelContext) -> Spreading | None:
    """Return the spreading factors of the robots; None if all have that of the radio, or it has none."""
    lora = radio.lora_or_none
    if lora is None:
        return None
    factor = context.antennas.spreading_factors(lora.spreading_factor)
    if (factor == lora.spreading_factor).all():
        return None
    return Spreading(lora, factor, len(context.keys), radio.max_payload_bytes + radio.overhead_bytes)


OMITTED, WEAK, STRONG = range(3)  # kinds of links in `link_table`


@njit()
def _separate(kind, power_mw, counts, a, b, fate, interferes, index, rejection):
    for i in range(len(a)):
        if index[a[i]] == index[b[i]]:
            continue
        for j in range(2):
            s, r = (a[i], b[i]) if j == 0 else (b[i], a[i])
            before = kind[j, i] & 3
            after = WEAK if interferes and before != OMITTED and fate[j, i] == UNDER_WAY else OMITTED
            kind[j, i] = after
            counts[s, before] -= 1
            counts[s, after] += 1
            power_mw[j, i] *= rejection[index[r], index[s]]
