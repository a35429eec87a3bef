"""Which pairs of robots a lone packet joins both ways while there are jammers."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.channel import ROUNDING
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.signal.jam_held import JamHeld
from swarmwire.comms.air.signal.link_table import Pairs
from swarmwire.comms.air.signal.links_held import LinksHeld
from swarmwire.comms.air.signal.numbers import edge_delivery
from swarmwire.comms.air.signal.outcome import jammed_delivery
from swarmwire.comms.air.signal.tables import Rules
from swarmwire.comms.arrays import BoolArray


def joined_despite(jam: JamHeld, links: LinksHeld, pairs: Pairs, radio: Radio, rules: Rules) -> BoolArray:
    """Which pairs, (k,): a packet meets either no jammer or all of them, each for the share of time that is so."""
    bits, least = edge_delivery(radio)
    power_mw, clear = jam.at_worst()
    joined = np.ones(len(pairs.a), np.bool_)
    for mean_dbm, receiver in zip(links.mean_dbm(pairs), (pairs.b, pairs.a), strict=True):
        lone = jammed_delivery(rules, mean_dbm, np.zeros(len(mean_dbm)), bits)
        jammed = jammed_delivery(rules, mean_dbm, power_mw[receiver], bits)
        joined &= clear[receiver] * lone + (1.0 - clear[receiver]) * jammed >= least - ROUNDING
    return joined
