"""Backends in real time: each act ends when its tick is over by the wall clock, whoever has answered by then."""

# pyright: reportUnknownMemberType=false

from dataclasses import dataclass, field, replace

import zenoh

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.clock import Clock, tick_start_ns, to_s
from swarmwire.comms.interfaces import ReceivingBackend, SubtickMedium, SubtickPackets
from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.world.backends.inbox import Item, RunnerInbox
from swarmwire.world.backends.join_policy import USUAL, JoinPolicy, ListenSettings
from swarmwire.world.backends.pacing import LatencyHistogram, Pace
from swarmwire.world.backends.realtime import RealTime
from swarmwire.world.backends.registry import OnLoss
from swarmwire.world.backends.zenoh_backend import BackendHooks, ZenohBackend
from swarmwire.world.subtick import Subticks


@dataclass(frozen=True)
class RealTimeReport:
    """What a run in real time did not manage; all 0 and empty if it kept up."""

    factor: float  # simulated s per s of wall time
    missed_ticks: int  # that were over before the loop came to wait for it: the next one started late
    worst_lag_s: float  # by how much at most, wall time
    late_answers: dict[str, int] = field(default_factory=dict[str, int])  # after their own tick, by robot
    watchdog_stops: dict[str, int] = field(default_factory=dict[str, int])  # by robot
    frames_dropped: int = 0  # to runners, never acted on: middleware loss
    packets_dropped: int = 0  # in these frames: received by the radio, never by the agent
    tx_status_dropped: int = 0  # in these frames: what radios knew of packets sent, and agents never learned
    subtick_s: float | None = None  # wall time after which the loop woke within ticks; None: it did not
    delivery: LatencyHistogram | None = (
        None  # packets: when they were handed over against when the modelled radio had them
    )
    tick_jitter: LatencyHistogram | None = None  # ticks: when they began against when the ones before were to end


def report_of(pace: Pace, subticks: Subticks | None) -> RealTimeReport:
    """How far a loop kept up."""
    return RealTimeReport(
        factor=pace.factor,
        missed_ticks=pace.missed_ticks,
        worst_lag_s=to_s(pace.worst_lag_ns),
        subtick_s=subticks.subtick_s if subticks else None,
        delivery=pace.delivery.delays(),
        tick_jitter=pace.jitter.delays(),
    )


class PacedBackend:
    """A backend in this process, paced by the wall clock: an agent that takes too long makes the loop lag."""

    def __init__(self, backend: ReceivingBackend, pace: Pace, subticks: Subticks | None = None) -> None:
        self._backend, self._pace, self._subticks = backend, pace, subticks
        self._puts: list[SubtickPackets] = []
        self.start, self.counts, self.close = backend.start, backend.counts, backend.close

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """What every robot does in this tick."""
        self._pace.begin()
        self._pace.handed_over(received.received_at_ns)
        actions = self._backend.act(tick, readings, received, tx_status)
        self._pace.hold(tick)
        return actions

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """The same, with packets handed over when they are due."""
        assert self._subticks
        self._pace.begin()
        self._pace.handed_over(received.received_at_ns)
        self._backend.receive(received, tx_status)
        actions = self._backend.act(tick, readings, ReceivedPackets.none(tuple(received.given)), NO_TX_STATUSES)
        self._puts.append(SubtickPackets(self._pace.now_ns(), tick, actions.sent))
        self._subticks.pass_tick(tick, medium, self)
        return replace(actions, sent=SentPackets.none())

    def take_in(self) -> list[SubtickPackets]:
        """What agents sent since the last call."""
        puts, self._puts = self._puts, []
        return puts

    def hand_over(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Let agents that read between ticks read."""
        self._backend.receive(received, tx_status)
        sent = self._backend.on_receive(tick, at_ns)
        if len(sent):
            self._puts.append(SubtickPackets(self._pace.now_ns(), None, sent))

    def report(self) -> RealTimeReport:
        """How far the loop kept up."""
        return report_of(self._pace, self._subticks)


class RealTimeBackend(ZenohBackend[RealTime]):
    """All agents of a run in runners, none of which the loop waits for; `realtime` decides, this carries the bytes."""

    congestion = zenoh.CongestionControl.DROP  # a runner that reads nothing must not hold up the world

    def __init__(
        self,
        door: ListenSettings | str,
        run_id: str,
        assignments: list[Assignment],
        timeout_s: float,
        clock: Clock,
        around: BackendHooks,
        on_loss: OnLoss,
        pace: Pace,
        watchdog_s: float,
        terms: JoinPolicy = USUAL,
        subticks: Subticks | None = None,
    ) -> None:
        roster = RealTime(assignments, watchdog_s, timeout_s, on_loss, terms, subtick=subticks is not None)
        super().__init__(door, run_id, roster, timeout_s, clock, around)
        self._pace, self._assignments, self._subticks = pace, assignments, subticks
        self._rate_hz = assignments[0].rate_hz
        if subticks:
            self._inbox = RunnerInbox(roster.limits, clock.now_ns)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """A frame to every runner; what has come when the tick is over."""
        self._send(self._roster.open_tick(tick, self._pace.begin(), readings, received, tx_status))
        self._pace.handed_over(received.received_at_ns)
        self._pace.hold(tick)
        self._take_in()
        return self._roster.take()

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """The same, with frames also between ticks, as packets come and are due."""
        assert self._subticks
        now_ns = self._pace.begin()
        self.hand_over(tick, tick_start_ns(tick, self._rate_hz), received, tx_status)
        self._pace.handed_over(received.received_at_ns)
        self._subticks.exchange(tick, medium, self)  # first what became due since the last tick's end
        self._send(self._roster.open_tick(tick, now_ns, readings, ReceivedPackets.none(), NO_TX_STATUSES))
        self._subticks.pass_tick(tick, medium, self)
        return self._roster.take()

    def take_in(self) -> list[SubtickPackets]:
        """Packets that arrived from runners since the last call."""
        self._take_in()
        return self._roster.puts()

    def hand_over(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """A frame to every runner that this concerns."""
        self._send(self._roster.hand_over(tick, at_ns, received, tx_status))

    def report(self) -> RealTimeReport:
        """How far loop and runners kept up."""
        roster = self._roster
        return replace(
            report_of(self._pace, self._subticks),
            late_answers=self._by_robot(roster.late),
            watchdog_stops=self._by_robot(roster.watchdog_stops),
            frames_dropped=roster.frames_dropped,
            packets_dropped=roster.packets_dropped,
            tx_status_dropped=roster.tx_status_dropped,
        )

    def _handle(self, item: Item) -> None:
        self._roster.now_ns = self._inbox.arrived_ns
        super()._handle(item)

    def _by_robot(self, counts: IntArray) -> dict[str, int]:
        """The counts that are not 0, by robot."""
        groups = [group for assignment in self._assignments for group in assignment.groups]
        pairs = [pair for group in groups for pair in zip(group.robot_names, counts[group.rows].tolist(), strict=True)]
        return {name: count for name, count in pairs if count}
