"""Sub-ticks: packets are sent and received also within a tick, for backends in real time.

`SubtickRadio` is the radio medium of such a loop:

    start of a tick   `step`       returns the results since the last tick, and received packets not yet delivered
    within the tick   `send`       packets of a step wait for their robot's send time, others are sent at once
                      `advance`    returns the packets received by then
                      `set_poses`  poses of robots of live sources, for packets on air from then on

The times of these calls do not change the course of a packet, so a run can be repeated from its inputs and their times.

`Subticks` wakes the loop many times in a tick. In every sub-tick `pop_sent` returns the packets that agents sent since
the last sub-tick, with their times; they go to the medium, the medium advances to the present, and `deliver` delivers
the received packets. The same happens at the end of the tick, with the agents' commands.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from swarmwire.comms.base.angles import wrap_angles
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.clock import NEVER_NS, Clock, tick_start_ns, to_ns
from swarmwire.comms.observe.interfaces import SubtickMedium, SubtickPackets
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.results import Results
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.world.backends.pacing import Pace

HEADING, COLUMNS = 3, np.array([0, 1, 3, 2])  # slot of the heading, and the column of each slot in poses (rows, 4)


class SubtickRadio:
    """The radio medium of a loop with sub-ticks."""

    def __init__(
        self, medium: RadioMedium, static: Static, readdress_invalid: Callable[[SentPackets], SentPackets]
    ) -> None:
        """Wrap a medium; `readdress_invalid` counts and readdresses packets with an invalid destination."""
        self._medium, self._static, self._readdress_invalid = medium, static, readdress_invalid
        self._rows = static.arenas * static.robots
        self._waiting = SentPackets.none()  # (k,) packets that wait for their send time
        self._send_ns = np.empty(0, np.int64)  # (k,) send time; NEVER_NS: already sent
        self._next_ns = NEVER_NS  # the earliest send time
        self._now_ns = 0
        self._pose: FloatArray = np.zeros((self._rows, 4))  # x, y in m, heading in rad, height in m

    def step(
        self, start_ns: int, pose: FloatArray, disruption: Disruption | None, radio: Radio | None
    ) -> tuple[Results, ReceivedPackets, TxStatuses]:
        """End the last tick, and begin a tick; see `RadioMedium.step`.

        Returns:
            The results of the medium, and the packets and transmit statuses among them that are not delivered yet.
        """
        self._release(start_ns)
        self._now_ns, self._pose = start_ns, pose
        # Receptions up to now count also for robots that die now, as if delivered within the tick.
        undelivered = self._medium.advance(start_ns)
        return self._medium.step(start_ns, pose, disruption, radio), *undelivered

    def send(self, packets: SubtickPackets) -> None:
        """Accept packets; their times must lie within the tick and must not fall from call to call."""
        if not len(packets.sent):
            return
        at_ns = max(packets.at_ns, self._now_ns)
        self._release(at_ns)
        sent = self._readdress_invalid(packets.sent)
        if packets.tick is None:
            self._medium.send_at(np.array([at_ns] * len(sent)), sent)
            return
        start_ns = tick_start_ns(packets.tick, self._static.rate_hz)
        send_ns = np.maximum(at_ns, self._medium.send_times(start_ns, packets.tick)[sent.sender])
        waits = np.flatnonzero(self._send_ns < NEVER_NS)
        self._waiting = SentPackets.joined([self._waiting.select(waits), sent]) if len(waits) else sent
        self._send_ns = np.concatenate((self._send_ns[waits], send_ns))
        self._next_ns = int(self._send_ns.min())
        self._release(at_ns)

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Advance to `until_ns`; return the packets received and the transmit statuses since the last call."""
        self._release(until_ns)
        self._now_ns = until_ns
        return self._medium.advance(until_ns)

    def set_poses(self, at_ns: int, poses: SparseTable) -> None:
        """Set poses from `at_ns` on, in slots x, y, z, heading."""
        self._now_ns = max(at_ns, self._now_ns)
        self._release(self._now_ns)
        pose, value = self._pose.copy(), np.where(poses.slot == HEADING, wrap_angles(poses.value), poses.value)
        pose[poses.rows, COLUMNS[poses.slot]] = value
        self._pose = pose  # the medium keeps the array
        self._medium.set_poses(self._now_ns, pose)

    def leave(self, over: BoolArray) -> None:
        """Send the waiting packets of the arenas `over` (arenas,) now, so that the medium ends them."""
        self._release(NEVER_NS, over)

    def end(self) -> None:
        """Send all waiting packets now, so that the medium ends them."""
        self._release(NEVER_NS)

    def _release(self, until_ns: int, arenas: BoolArray | None = None) -> None:
        """Send the packets of robots (in `arenas`, (arenas,), or in all) up to a time, in the order of send times."""
        while self._next_ns <= until_ns and self._next_ns < NEVER_NS:
            due = self._send_ns <= min(until_ns, NEVER_NS - 1)
            if arenas is not None:
                due &= arenas[self._waiting.sender // self._static.robots]
            index = np.flatnonzero(due)
            if not len(index):
                return
            sender, send_ns = self._waiting.sender[index], self._send_ns[index]
            # The packets of a robot are in the order in which it sent them, which is that of their send times.
            first_ns = np.full(self._rows, NEVER_NS)
            first_ns[sender[::-1]] = send_ns[::-1]
            is_first = send_ns == first_ns[sender]
            first = index[is_first]
            self._medium.send_at(send_ns[is_first], self._waiting.select(first))
            self._send_ns[first] = NEVER_NS
            self._next_ns = int(self._send_ns.min())


MEAN_SLEEPS = 16  # number of sleeps over which their lateness is averaged, about
MAX_EARLY_SHARE = 5  # a sleep is shorter by at most a fifth of a sub-tick: a machine that wakes later is busy


class Exchange(Protocol):
    """The exchange of packets between agents and the radio medium."""

    def pop_sent(self) -> Sequence[SubtickPackets]:
        """Return the packets that agents sent since the last call, `at_ns` in wall time."""
        ...

    def deliver(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Deliver packets and transmit statuses to their robots now, at `at_ns` of simulated time."""
        ...


class Subticks:
    """The sub-ticks of ticks, by the wall clock.

    Attributes:
        subtick_s: length of a sub-tick in wall time.
    """

    def __init__(self, clock: Clock, pace: Pace, rate_hz: int, subtick_s: float) -> None:
        self.subtick_s = subtick_s
        self._clock, self._pace, self._rate_hz, self._subtick_ns = clock, pace, rate_hz, to_ns(subtick_s)
        self._last_ns = 0  # time to which the medium has advanced
        self._late_ns = 0  # mean lateness of the latest sleeps

    def pass_tick(self, tick: int, medium: SubtickMedium, exchange: Exchange) -> None:
        """Wait until the tick is over by the wall clock, and deliver all packets that are due by then."""
        last_ns = self._pace.end_ns(tick) - self._subtick_ns  # a later sub-tick could last beyond the tick's end
        wake_ns = self._clock.now_ns()
        while wake_ns <= last_ns:
            self._sleep_until(wake_ns)
            self.exchange(tick, medium, exchange)
            # After a late wake-up the next sub-tick is a full sub-tick later: missed sub-ticks are skipped.
            wake_ns = max(wake_ns + self._subtick_ns, self._clock.now_ns())
        self._pace.wait(tick)
        self.exchange(tick, medium, exchange)

    def _sleep_until(self, at_ns: int) -> None:
        """Sleep until about a time: the sleep ends earlier by the mean lateness of the machine's wake-ups."""
        early_ns = at_ns - min(self._late_ns, self._subtick_ns // MAX_EARLY_SHARE)
        if self._clock.now_ns() < early_ns:
            self._clock.sleep_until(early_ns)
            self._late_ns += (self._clock.now_ns() - early_ns - self._late_ns) // MEAN_SLEEPS

    def exchange(self, tick: int, medium: SubtickMedium, exchange: Exchange) -> None:
        """Send the packets that agents sent, and deliver the packets that are due."""
        pace, sent = self._pace, exchange.pop_sent()
        start_ns, end_ns = tick_start_ns(tick, self._rate_hz), tick_start_ns(tick + 1, self._rate_hz)
        now_ns = min(max(start_ns, pace.simulated_ns(self._clock.now_ns()), self._last_ns), end_ns)
        from_ns = max(start_ns, self._last_ns)
        for packets in sent:
            # The network's threads queue packets nearly in the order of their arrival: no time may fall.
            from_ns = min(max(from_ns, pace.simulated_ns(packets.at_ns)), now_ns)
            medium.send(packets._replace(at_ns=from_ns))
        self._last_ns = now_ns
        received, tx_status = medium.advance(now_ns)
        if len(received) or len(tx_status):
            exchange.deliver(tick, now_ns, received, tx_status)
            pace.count_delivered(received.received_at_ns)
