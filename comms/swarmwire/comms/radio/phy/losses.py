"""Losses: what takes a frame that was received right, beside noise and interference.

A further loss is a field of `Losses`, its line in each of the functions below, and, for the unit disk, a stage.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.kernels import kernel
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.reception.bursts import Bursting, BurstStates, takes
from swarmwire.comms.radio.stages.losses import LOSS, TRACE
from swarmwire.comms.radio.stages.stage import ChannelContext
from swarmwire.comms.radio.traces import LinkTraces

ANSWER_LOSS, ANSWER_TRACE = purpose("fixed loss of an acknowledgement"), purpose("trace of an acknowledgement")
RECEIVED, LOST, BURST = int(Fate.RECEIVED), int(Fate.LOST), int(Fate.BURST)


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


@kernel()
def takes_none(losses):
    """Whether there is nothing that could take a frame."""
    return losses.loss == 0.0 and len(losses.traced.link) == 0 and not losses.has_bursts


@kernel()
def taken_by(losses, key, robots, link, s, r, sequence, attempt, is_answer, at_ns):
    """The fate that a loss gives to a frame from s to r, indices in the arena, or RECEIVED.

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
    return RECEIVED


@kernel()
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


# --- Measured links of signals: their strengths stand in for the model's, each direction with its own.


class MeasuredLinks:
    """What a radio's trace says of the links of all arenas, which are measured alike, at one moment."""

    def __init__(
        self, traces: LinkTraces, others: str, robots: int, arenas: int, send_dbm: FloatArray, receive_dbi: FloatArray
    ) -> None:
        """`others` is the radio's `trace.others`; `robots` stand in each arena.

        `send_dbm` and `receive_dbi` (robots,) are what the antennas had when links were measured: what events change of
        them then counts on top.
        """
        self._send_dbm, self._receive_dbi = send_dbm, receive_dbi
        self._traces, self._others_end = traces, others == "none"
        self._robots, self._arenas = robots, arenas
        self._link = np.unique(np.concatenate([np.empty(0, np.int64), *(trace.link for trace in traces.all)]))
        self.move_to(0)

    @classmethod
    def of(cls, context: ChannelContext) -> "MeasuredLinks | None":
        """Those of the radio's trace; None without one."""
        if context.traces is None or context.radio.trace is None:
            return None
        antennas, antenna = context.antennas, context.radio.antenna_or_default
        own = antennas.send_dbm(antenna), antennas.receive_dbi(antenna)
        return cls(context.traces, context.radio.trace.others, context.robots, len(context.keys), *own)

    def move_to(self, now_ns: int) -> None:
        """It is this time from now on."""
        sender, receiver = np.divmod(self._link, self._robots)
        at_ns = np.full(len(sender), now_ns)
        unknown = np.full(len(sender), np.nan)
        strength, ratio = self._traces.rssi_dbm, self._traces.delivery_ratio
        self._rssi_dbm = unknown if strength is None else strength.at(sender, receiver, at_ns)
        self._ratio = unknown if ratio is None else ratio.at(sender, receiver, at_ns)
        self._known = self._traces.known(sender, receiver, at_ns)

    @property
    def traced(self) -> Traced:
        """The links with a delivery ratio."""
        has = ~np.isnan(self._ratio)
        return Traced(self._link[has], self._ratio[has])

    def ratio(self, sender: IntArray, receiver: IntArray) -> FloatArray:
        """The delivery ratio of links between robot rows, (k,); 1 where none is known."""
        return np.nan_to_num(self._of(self._ratio, np.nan, sender, receiver), nan=1.0)

    def with_unlisted(self, a: IntArray, b: IntArray, loss_db: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Pairs of robot rows a < b (k,), and after them those of known strength that are not among them: loss inf."""
        rows = self._robots * self._arenas
        one, other = np.divmod(self._link[~np.isnan(self._rssi_dbm)], self._robots)
        first = self._robots * np.arange(self._arenas)[:, None]
        known = ((first + np.minimum(one, other)) * rows + first + np.maximum(one, other)).ravel()
        more_a, more_b = np.divmod(np.setdiff1d(known, a * rows + b), rows)
        a, b = np.concatenate([a, more_a]), np.concatenate([b, more_b])
        return a, b, np.concatenate([loss_db, np.full(len(more_a), np.inf)])

    def loss_db(self, sender: IntArray, receiver: IntArray, modelled_db: FloatArray) -> tuple[FloatArray, BoolArray]:
        """The loss of links between robot rows, (k,), and whether it was measured; `modelled_db` is the model's."""
        budget_db = self._send_dbm[sender % self._robots] + self._receive_dbi[receiver % self._robots]
        rssi_dbm = self._of(self._rssi_dbm, np.nan, sender, receiver)
        is_measured = ~np.isnan(rssi_dbm)
        loss = np.where(is_measured, budget_db - rssi_dbm, modelled_db)
        if self._others_end:
            loss[~self._of(self._known, False, sender, receiver)] = np.inf
        return loss, is_measured

    def _of(self, values, missing, sender: IntArray, receiver: IntArray):
        """Those of the links between robot rows, or what stands for links that were never measured."""
        robots = self._robots
        link = sender % robots * robots + receiver % robots
        if not len(self._link):
            return np.full(len(link), missing)
        place = np.minimum(np.searchsorted(self._link, link), len(self._link) - 1)
        return np.where(self._link[place] == link, values[place], missing)
