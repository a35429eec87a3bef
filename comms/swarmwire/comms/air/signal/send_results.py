"""What senders learn of their packets, where radios acknowledge."""

import numpy as np

from swarmwire.comms.air.signal.tables import NOT_LEARNED, Table
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.outcomes import NO_OUTCOMES, Outcomes, SendResult
from swarmwire.comms.packets import NOWHERE, UNTOLD, Sent


def learned(packet: Table, outcome_id: IntArray) -> Outcomes:
    """Of packets that are done, what senders learn who ask; those that died before are not there to learn it."""
    died = (packet["fate"] == Fate.SENDER_DEAD) | (packet["result"] == NOT_LEARNED)
    asked = (packet["is_done"] > 0) & (outcome_id != UNTOLD) & ~died
    index = np.flatnonzero(asked)
    if not len(index):
        return NO_OUTCOMES
    return Outcomes(packet["sender"][index], outcome_id[index], packet["result"][index])


def sent_in_vain(sent: Sent, max_payload_bytes: int) -> Outcomes:
    """Of packets to robots that are not there, what senders learn who ask: nobody answers."""
    index = np.flatnonzero((sent.to == NOWHERE) & (sent.outcome_ids != UNTOLD))
    if not len(index):
        return NO_OUTCOMES
    return Outcomes(
        sent.sender[index], sent.outcome_ids[index], result_at_first(sent.payloads.sizes[index], max_payload_bytes)
    )


def result_at_first(size_bytes: IntArray, max_payload_bytes: int) -> IntArray:
    """The results of packets (k,) until something better, or worse, comes of them."""
    return np.where(size_bytes > max_payload_bytes, int(SendResult.TOO_LARGE), int(SendResult.NO_ACKNOWLEDGEMENT))
