"""Send times: the offset within its period at which a robot sends its packets."""

import numpy as np

from swarmwire.comms.base.arrays import IntArray, KeyArray, writeable
from swarmwire.comms.base.clock import NS_PER_S, to_ns
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel, njit

PHASE, JITTER = purpose("send phase"), purpose("send jitter")
JITTER_SHARE = 5  # the jitter spans a fifth of the period, so that a robot's packets keep their order


class SendTimes:
    """`sent_at = tick start + phase + jitter`, in integer ns.

    "uniform": phase keyed by robot, uniform over the period in which it acts; jitter keyed by robot and tick, uniform
    over a fifth of it. Without them all robots would send at once, and a medium with contention would lose every
    packet.
    "tick": no offset. A number: that offset in s from the tick's start, the same for all.
    """

    def __init__(self, send_offset: str | float, keys: KeyArray, act_every_ticks: IntArray, rate_hz: int) -> None:
        """`act_every_ticks` (robots,): the period of each robot index, in ticks of `rate_hz`."""
        self._keys, robots = keys, len(act_every_ticks)
        self._period_ns = act_every_ticks * NS_PER_S // rate_hz
        self._uniform = send_offset == "uniform"
        if self._uniform:
            self._jitter_ns = self._period_ns // JITTER_SHARE
            self._phase_ns = keyed_ns(keys, 0, PHASE, self._period_ns)
            return
        offset_s = 0.0 if send_offset == "tick" else send_offset
        if isinstance(offset_s, str) or not offset_s >= 0.0:
            raise ValueError(f'send_offset: expected "uniform", "tick" or at least 0 s, got {send_offset!r}')
        self._phase_ns = np.full(len(keys) * robots, to_ns(offset_s), np.int64)

    def in_tick(self, tick_start_ns: int, tick: int) -> IntArray:
        """Return the send time of each robot in this tick, in ns, (rows,)."""
        sent_at_ns = self._phase_ns + tick_start_ns
        if self._uniform:
            sent_at_ns += keyed_ns(self._keys, tick, JITTER, self._jitter_ns)
        return sent_at_ns

    def of_senders(self, tick_start_ns: int, tick: int, sender: IntArray) -> IntArray:
        """Return the send time of each robot row `sender` in this tick, in ns, (k,)."""
        if not self._uniform:
            return self._phase_ns[sender] + tick_start_ns
        return _times_of(writeable(sender), tick_start_ns, tick, self._phase_ns, self._keys, self._jitter_ns)


@njit()
def _times_of(
    sender: IntArray, start_ns: int, tick: int, phase_ns: IntArray, keys: KeyArray, jitter_ns: IntArray
) -> IntArray:
    times_ns, robots = np.empty(len(sender), np.int64), len(jitter_ns)
    for k in range(len(sender)):
        row = sender[k]
        times_ns[k] = start_ns + phase_ns[row] + _keyed_ns(keys, row, tick, JITTER, jitter_ns, robots)
    return times_ns


@kernel()
def _keyed_ns(keys: KeyArray, row: int, tick: int, draw_purpose: int, width_ns: IntArray, robots: int):
    i = row % robots
    return np.int64(uniform(keys[row // robots], i, tick, 0, draw_purpose) * width_ns[i])


@njit()
def keyed_ns(keys: KeyArray, tick: int, draw_purpose: int, width_ns: IntArray) -> IntArray:
    """Draw a time for each robot, uniform over 0 to its width_ns (robots,) - 1.

    Keyed by (robot, tick, 0, draw_purpose).
    """
    robots = len(width_ns)
    draws = np.empty(len(keys) * robots, np.int64)
    for row in range(len(draws)):
        draws[row] = _keyed_ns(keys, row, tick, draw_purpose, width_ns, robots)
    return draws
