"""Losses of the PHY beyond noise and interference: fixed loss, measured delivery ratios and bursts.

They apply to frames that were received without errors. To add a loss, add a field to `Losses`, a line to each function
below and, for the unit disk, a stage. `MeasuredLinks` replaces modelled link strengths by those of a trace.
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

ACK_LOSS, ACK_TRACE = purpose("fixed loss of an acknowledgement"), purpose("trace of an acknowledgement")
RECEIVED, LOST, BURST = int(Fate.RECEIVED), int(Fate.LOST), int(Fate.BURST)


class Traced(NamedTuple):
    """Links whose delivery ratio was measured, in every arena alike."""

    link: IntArray  # (links,) sender x robots + receiver, as indices in the arena; rising
    ratio: FloatArray  # (links,)


NOT_TRACED = Traced(np.empty(0, np.int64), np.empty(0))


class Losses(NamedTuple):
    """Parameters of the losses."""

    loss: float  # the same everywhere
    traced: Traced
    has_bursts: bool
    bursts: Bursting


def losses_of(radio: Radio, traced: Traced, bursts: BurstStates) -> Losses:
    """The losses of a radio; `bursts` has room for the links that may be used."""
    return Losses(radio.loss, traced, radio.bursts is not None, bursts.bursting)


def passing_share(radio: Radio) -> float:
    """Long-run share of packets that survive all losses, on links without measurements."""
    return (1.0 - radio.loss) * (1.0 - (radio.bursts.loss if radio.bursts else 0.0))


@kernel()
def has_no_loss(losses):
    """Whether no loss is configured."""
    return losses.loss == 0.0 and len(losses.traced.link) == 0 and not losses.has_bursts


@kernel()
def loss_fate(losses, key, robots, link, s, r, sequence, attempt, is_ack, at_ns):
    """The fate of a frame from s to r (indices in the arena): LOST, BURST, or RECEIVED if no loss applies.

    Draws are keyed by (sender, receiver, sequence) and attempt. Acknowledgements have separate draws, and bursts do not
    affect them. `link` is the link number of the robot rows as in `BurstStates`; `at_ns` is the time on air.
    """
    fixed_loss, trace = (ACK_LOSS, ACK_TRACE) if is_ack else (LOSS, TRACE)
    if losses.loss > 0.0 and uniform(key, s, r, sequence, fixed_loss + attempt) < losses.loss:
        return LOST
    if len(losses.traced.link) > 0:
        ratio = _ratio(losses.traced, s * robots + r)
        if ratio < 1.0 and uniform(key, s, r, sequence, trace + attempt) >= ratio:
            return LOST
    if losses.has_bursts and not is_ack and takes(losses.bursts, link, key, s, r, sequence, attempt, at_ns):
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


class MeasuredLinks:
    """Measured strength and delivery ratio of each directed link at one time; the same in all arenas.

    Measured strengths replace the modelled ones, separately for each direction.
    """

    def __init__(
        self, traces: LinkTraces, others: str, robots: int, arenas: int, send_dbm: FloatArray, receive_dbi: FloatArray
    ) -> None:
        """`others` is the radio's `trace.others`; `robots` stand in each arena.

        `send_dbm` and `receive_dbi` (robots,) are the antenna values during the measurement: gains that events change
        count on top.
        """
        self._send_dbm, self._receive_dbi = send_dbm, receive_dbi
        self._traces, self._others_end = traces, others == "none"
        self._robots, self._arenas = robots, arenas
        self._link = np.unique(np.concatenate([np.empty(0, np.int64), *(trace.link for trace in traces.all)]))
        self.move_to(0)

    @classmethod
    def of(cls, context: ChannelContext) -> "MeasuredLinks | None":
        """The links of the radio's trace; None without a trace."""
        if context.traces is None or context.radio.trace is None:
            return None
        antennas, antenna = context.antennas, context.radio.antenna_or_default
        antenna_values = antennas.send_dbm(antenna), antennas.receive_dbi(antenna)
        return cls(context.traces, context.radio.trace.others, context.robots, len(context.keys), *antenna_values)

    def move_to(self, now_ns: int) -> None:
        """Look up the values at `now_ns`."""
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
        measured = ~np.isnan(self._ratio)
        return Traced(self._link[measured], self._ratio[measured])

    def ratio(self, sender: IntArray, receiver: IntArray) -> FloatArray:
        """Delivery ratio of links between robot rows, (k,); 1 where none was measured."""
        return np.nan_to_num(self._of(self._ratio, np.nan, sender, receiver), nan=1.0)

    def with_unlisted(self, a: IntArray, b: IntArray, loss_db: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Pairs of robot rows a < b (k,), then missing pairs of measured strength, with loss inf."""
        rows = self._robots * self._arenas
        one, other = np.divmod(self._link[~np.isnan(self._rssi_dbm)], self._robots)
        first = self._robots * np.arange(self._arenas)[:, None]
        known = ((first + np.minimum(one, other)) * rows + first + np.maximum(one, other)).ravel()
        more_a, more_b = np.divmod(np.setdiff1d(known, a * rows + b), rows)
        a, b = np.concatenate([a, more_a]), np.concatenate([b, more_b])
        return a, b, np.concatenate([loss_db, np.full(len(more_a), np.inf)])

    def loss_db(self, sender: IntArray, receiver: IntArray, modelled_db: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Loss of links between robot rows, (k,), and whether it was measured; else `modelled_db`."""
        budget_db = self._send_dbm[sender % self._robots] + self._receive_dbi[receiver % self._robots]
        rssi_dbm = self._of(self._rssi_dbm, np.nan, sender, receiver)
        is_measured = ~np.isnan(rssi_dbm)
        loss = np.where(is_measured, budget_db - rssi_dbm, modelled_db)
        if self._others_end:
            loss[~self._of(self._known, False, sender, receiver)] = np.inf
        return loss, is_measured

    def _of(self, values, missing, sender: IntArray, receiver: IntArray):
        """Values of the links between robot rows, (k,); `missing` for links that were never measured."""
        robots = self._robots
        link = sender % robots * robots + receiver % robots
        if not len(self._link):
            return np.full(len(link), missing)
        place = np.minimum(np.searchsorted(self._link, link), len(self._link) - 1)
        return np.where(self._link[place] == link, values[place], missing)
