"""Measured links of signals: their strengths stand in for the model's, each direction with its own."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.signal.losses import Traced
from swarmwire.comms.air.stages.stage import Medium
from swarmwire.comms.air.traces.link_traces import LinkTraces
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray


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
    def of(cls, medium: Medium) -> "MeasuredLinks | None":
        """Those of the radio's trace; None without one."""
        if medium.traces is None or medium.radio.trace is None:
            return None
        antennas, antenna = medium.antennas, medium.radio.antenna_or_default
        own = antennas.send_dbm(antenna), antennas.receive_dbi(antenna)
        return cls(medium.traces, medium.radio.trace.others, medium.robots, len(medium.keys), *own)

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
