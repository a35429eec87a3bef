"""Packets that radios took up, as rows of the table that events work on."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.signal.send_results import result_at_first
from swarmwire.comms.air.signal.tables import NOBODY, PACKET, Table
from swarmwire.comms.air.timing.access_timing import IEEE_802_15_4
from swarmwire.comms.air.timing.frames import airtime_ns
from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import BROADCAST

HEADER_BYTES = 6  # of IEEE 802.15.4 before its PSDU


def packet_rows(taken: Transmissions, radio: Radio, robots: int) -> Table:
    """Rows of dtype PACKET for packets that wait at their radios, (k,)."""
    frame_bytes = taken.payloads.sizes + radio.overhead_bytes
    packet: Table = np.zeros(len(taken.sender), PACKET)
    packet["sender"], packet["sequence"] = taken.sender, taken.sequence
    packet["to"] = np.where(taken.to == BROADCAST, NOBODY, taken.sender - taken.sender % robots + taken.to)
    packet["sent_at_ns"] = packet["on_air_at_ns"] = taken.sent_at_ns
    packet["airtime_ns"], packet["bits"] = airtime_ns(radio, frame_bytes), 8 * frame_bytes
    packet["refused"] = np.where(taken.payloads.sizes > radio.max_payload_bytes, int(Fate.TOO_LARGE), 0)
    packet["result"] = result_at_first(taken.payloads.sizes, radio.max_payload_bytes)
    if radio.access_or_default.method == "csma-802154":
        packet["pause_ns"] = IEEE_802_15_4.space_ns(frame_bytes - HEADER_BYTES)
    return packet
