"""Losses: what takes a frame that was received right, beside noise and interference.

A further loss is a field of `Losses`, its line in each of the functions below, and, for the disk, a stage.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.reception.burst_states import Bursting, BurstStates, takes
from swarmwire.comms.air.stages.fixed_loss import LOSS
from swarmwire.comms.air.stages.trace import TRACE
from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.borrowing import borrowing
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.fates import Fate

ANSWER_LOSS, ANSWER_TRACE = purpose("fixed loss of an acknowledgement"), purpose("trace of an acknowledgement")
HEARD, LOST, BURST = int(Fate.HEARD), int(Fate.LOST), int(Fate.BURST)


class Traced(NamedTuple):
    """Links whose delivery ratio was measured, in every arena alike."""

    link: IntArray  # (links,) sender x robots + receiver, as indices in the arena; rising
    ratio: FloatArray  # (links,)


NOT_TRACED = Traced(np.empty(0, np.int64), np.empty(0))


class Losses(NamedTuple):
    """What losses there are, in numbers."""

    loss: float  # the same everywhere
    traced: Traced
    has_bursts: bool
    bursts: Bursting


def losses_of(radio: Radio, traced: Traced, bursts: BurstStates) -> Losses:
    """Those of the radio; `bursts` has room for the links that may be used."""
    return Losses(radio.loss, traced, radio.bursts is not None, bursts.bursting)


def passing_share(radio: Radio) -> float:
    """The share of packets that none of them takes in the long run, on links that were not measured."""
    return (1.0 - radio.loss) * (1.0 - (radio.bursts.loss if radio.bursts else 0.0))


@borrowing()
def takes_none(losses):
    """Whether there is nothing that could take a frame."""
    return losses.loss == 0.0 and len(losses.traced.link) == 0 and not losses.has_bursts


@borrowing()
def taken_by(losses, key, robots, link, s, r, sequence, attempt, is_answer, at_ns):
    """The fate that a loss gives to a frame from s to r, indices in the arena, or HEARD.

    Draws are keyed by (sender, receiver, sequence), and attempt; an acknowledgement has draws of its own, and no burst
    takes it. `link` is that of the robot rows, as `BurstStates` counts them; the frame went on air at `at_ns`.
    """
    fixed_loss, trace = (ANSWER_LOSS, ANSWER_TRACE) if is_answer else (LOSS, TRACE)
    if losses.loss > 0.0 and uniform(key, s, r, sequence, fixed_loss + attempt) < losses.loss:
        return LOST
    if len(losses.traced.link) > 0:
        ratio = _ratio(losses.traced, s * robots + r)
        if ratio < 1.0 and uniform(key, s, r, sequence, trace + attempt) >= ratio:
            return LOST
    if losses.has_bursts and not is_answer and takes(losses.bursts, link, key, s, r, sequence, attempt, at_ns):
        return BURST
    return HEARD


@borrowing()
def _ratio(traced, link):
    """The delivery ratio of a link (indices in the arena: sender x robots + receiver); 1 where none was measured."""
    low, high = 0, len(traced.link)
    while low < high:
        middle = (low + high) // 2
        if traced.link[middle] < link:
            low = middle + 1
        else:
            high = middle
    return traced.ratio[low] if low < len(traced.link) and traced.link[low] == link else 1.0
