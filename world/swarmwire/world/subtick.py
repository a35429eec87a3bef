"""Sub-ticks: packets are sent and received also within a tick, for backends in real time.

`SubtickRadio` is the radio medium of such a loop:

    start of a tick   `step`       results since the last tick, for observers; of these, those not yet delivered
    within the tick   `send`       packets of a step wait for their robot's turn, others are sent at once
                      `advance`    received packets are delivered when they are due

The times of these calls do not change the course of a packet, so a run can be repeated from its inputs and their times.

`Subticks` wakes the loop many times in a tick. In every sub-tick `take_in` returns the packets that agents sent since
the last one, with their times; they go to the medium, the medium advances to the present, and `hand_over` delivers the
received packets. The same happens at the end of the tick, where commands are taken as usual.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.clock import NEVER_NS, Clock, tick_start_ns, to_ns
from swarmwire.comms.observe.interfaces import SubtickMedium, SubtickPackets
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.results import Results
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.world.backends.pacing import Pace


class SubtickRadio:
    """a medium between `begin` of one tick and that of the next."""

    def __init__(self, medium: RadioMedium, static: Static, addressable: Callable[[SentPackets], SentPackets]) -> None:
        """`addressable` makes packets fit for the medium, and counts what was wrong with them."""
        self._medium, self._static, self._addressable = medium, static, addressable
        self._rows = static.arenas * static.robots
        self._waiting = SentPackets.none()  # (k,) that were put on air, each until its robot's turn comes
        self._turn_ns = np.empty(0, np.int64)  # (k,) NEVER_NS: it came
        self._next_ns = NEVER_NS  # the first turn to come
        self._now_ns = 0

    def step(
        self, start_ns: int, pose: FloatArray, disruption: Disruption | None, radio: Radio | None
    ) -> tuple[Results, ReceivedPackets, TxStatuses]:
        """End the last tick, and begin one as `RadioMedium.step`; its results, and what of them was not delivered."""
        self._release(start_ns)
        self._now_ns = start_ns
        # What has been received by now was received, also by who dies now: as if it had been handed over in the tick.
        undelivered = self._medium.advance(start_ns)
        return self._medium.step(start_ns, pose, disruption, radio), *undelivered

    def send(self, packets: SubtickPackets) -> None:
        """Take packets that came no sooner than those before them, and within the tick."""
        if not len(packets.sent):
            return
        at_ns = max(packets.at_ns, self._now_ns)
        self._release(at_ns)
        sent = self._addressable(packets.sent)
        if packets.tick is None:
            self._medium.send_at(np.array([at_ns] * len(sent)), sent)
            return
        start_ns = tick_start_ns(packets.tick, self._static.rate_hz)
        turn_ns = np.maximum(at_ns, self._medium.send_times(start_ns, packets.tick)[sent.sender])
        waits = np.flatnonzero(self._turn_ns < NEVER_NS)
        self._waiting = SentPackets.joined([self._waiting.select(waits), sent]) if len(waits) else sent
        self._turn_ns = np.concatenate((self._turn_ns[waits], turn_ns))
        self._next_ns = int(self._turn_ns.min())
        self._release(at_ns)

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Let time pass; return the receptions and transmit statuses that were not handed out before."""
        self._release(until_ns)
        self._now_ns = until_ns
        return self._medium.advance(until_ns)

    def leave(self, over: BoolArray) -> None:
        """The arenas (arenas,) are over: what waits there for a turn is the medium's to end."""
        self._release(NEVER_NS, over)

    def end(self) -> None:
        """The run is over: what waits for a turn is the medium's to end."""
        self._release(NEVER_NS)

    def _release(self, until_ns: int, arenas: BoolArray | None = None) -> None:
        """Hand to the radios what robots, of these arenas (arenas,), send until then, in the order of their turns."""
        while self._next_ns <= until_ns and self._next_ns < NEVER_NS:
            due = self._turn_ns <= min(until_ns, NEVER_NS - 1)
            if arenas is not None:
                due &= arenas[self._waiting.sender // self._static.robots]
            place = np.flatnonzero(due)
            if not len(place):
                return
            sender, turn_ns = self._waiting.sender[place], self._turn_ns[place]
            # A robot's packets stand in the order in which it sent them, which is that of their turns.
            first_ns = np.full(self._rows, NEVER_NS)
            first_ns[sender[::-1]] = turn_ns[::-1]
            comes_first = turn_ns == first_ns[sender]
            going = place[comes_first]
            self._medium.send_at(turn_ns[comes_first], self._waiting.select(going))
            self._turn_ns[going] = NEVER_NS
            self._next_ns = int(self._turn_ns.min())


MEAN_OF = 16  # sleeps, about: that were late
SHARE_EARLY = 5  # of a subtick, at most, that a sleep is shorter: a machine that wakes later than that is busy


class Exchange(Protocol):
    """The carrier of packets between agents and the radio medium."""

    def take_in(self) -> Sequence[SubtickPackets]:
        """Packets that agents sent since the last call, `at_ns` in wall time."""
        ...

    def hand_over(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Hand this to those that it is for, now, at `at_ns` of simulated time."""
        ...


class Subticks:
    """The subticks of ticks, by the wall clock.

    Attributes:
        subtick_s: wall time.
    """

    def __init__(self, clock: Clock, pace: Pace, rate_hz: int, subtick_s: float) -> None:
        self.subtick_s = subtick_s
        self._clock, self._pace, self._rate_hz, self._subtick_ns = clock, pace, rate_hz, to_ns(subtick_s)
        self._last_ns = 0  # up to which the medium has advanced
        self._wakes_late_ns = 0  # by how much sleeps ended late, of late

    def pass_tick(self, tick: int, medium: SubtickMedium, exchange: Exchange) -> None:
        """Return once the tick is over by the wall clock, and all that is due by then was handed over."""
        last_ns = self._pace.over_ns(tick) - self._subtick_ns  # later, there may not be the time before the tick's end
        wake_ns = self._clock.now_ns()
        while wake_ns <= last_ns:
            self._sleep_until(wake_ns)
            self.exchange(tick, medium, exchange)
            # Whoever woke late goes on from there: subticks that were missed are not made up for.
            wake_ns = max(wake_ns + self._subtick_ns, self._clock.now_ns())
        self._pace.hold(tick)
        self.exchange(tick, medium, exchange)

    def _sleep_until(self, at_ns: int) -> None:
        """Sleep, for less by what the machine takes to wake; a little early or late does not matter here."""
        early_ns = at_ns - min(self._wakes_late_ns, self._subtick_ns // SHARE_EARLY)
        if self._clock.now_ns() < early_ns:
            self._clock.sleep_until(early_ns)
            self._wakes_late_ns += (self._clock.now_ns() - early_ns - self._wakes_late_ns) // MEAN_OF

    def exchange(self, tick: int, medium: SubtickMedium, exchange: Exchange) -> None:
        """Take in what came, and hand over what is due."""
        pace, came = self._pace, exchange.take_in()
        start_ns, end_ns = (tick_start_ns(of, self._rate_hz) for of in (tick, tick + 1))
        now_ns = min(max(start_ns, pace.simulated_ns(self._clock.now_ns()), self._last_ns), end_ns)
        from_ns = max(start_ns, self._last_ns)
        for put in came:
            # The network's threads put in what came in nearly the order in which it did.
            from_ns = min(max(from_ns, pace.simulated_ns(put.at_ns)), now_ns)
            medium.send(put._replace(at_ns=from_ns))
        self._last_ns = now_ns
        received, tx_status = medium.advance(now_ns)
        if len(received) or len(tx_status):
            exchange.hand_over(tick, now_ns, received, tx_status)
            pace.handed_over(received.received_at_ns)
