"""Real-time backends: each `act` returns when its tick ends by the wall clock, with the answers so far.

`PacedBackend` paces a backend in this process. `RealTimeBackend` connects runners over zenoh. `RealTimeReport` says how
far a run kept up with the wall clock.
"""

# pyright: reportUnknownMemberType=false

from dataclasses import dataclass, field, replace

import zenoh

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.clock import Clock, tick_start_ns, to_s
from swarmwire.comms.observe.interfaces import ReceivingBackend, SubtickMedium, SubtickPackets
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire.assignment import Assignment
from swarmwire.world.backends.inbox import Item, RunnerInbox
from swarmwire.world.backends.join_policy import JoinPolicy, ListenSettings
from swarmwire.world.backends.pacing import LatencySummary, Pace
from swarmwire.world.backends.realtime import RealTime
from swarmwire.world.backends.registry import OnLoss
from swarmwire.world.backends.zenoh_backend import BackendHooks, ZenohBackend
from swarmwire.world.subtick import Subticks


@dataclass(frozen=True)
class RealTimeReport:
    """Deadlines that a run in real time missed; all 0 and empty if it kept up."""

    factor: float  # simulated s per s of wall time
    missed_ticks: int  # that ended before the loop waited for their end: the next one started late
    worst_lag_s: float  # the greatest lag, wall time
    late_answers: dict[str, int] = field(default_factory=dict[str, int])  # after their own tick, by robot
    watchdog_stops: dict[str, int] = field(default_factory=dict[str, int])  # by robot
    frames_dropped: int = 0  # to runners, never acted on: middleware loss
    packets_dropped: int = 0  # in these frames: received by the radio, never by the agent
    tx_status_dropped: int = 0  # transmit statuses in these frames: known to the radio, never to the agent
    subtick_s: float | None = None  # wall time after which the loop woke within ticks; None: it did not
    delivery: LatencySummary | None = None  # of the delivery of packets after their reception by the modelled radio
    tick_jitter: LatencySummary | None = None  # of the start of ticks after the planned end of the tick before


def report_of(pace: Pace, subticks: Subticks | None) -> RealTimeReport:
    """The report of a loop."""
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
        """The actions of all robots in this tick."""
        self._pace.begin()
        self._pace.handed_over(received.received_at_ns)
        actions = self._backend.act(tick, readings, received, tx_status)
        self._pace.hold(tick)
        return actions

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """As `act`, with packets delivered when they are due."""
        assert self._subticks
        self._pace.begin()
        self._pace.handed_over(received.received_at_ns)
        self._backend.receive(received, tx_status)
        actions = self._backend.act(tick, readings, ReceivedPackets.none(tuple(received.measured)), NO_TX_STATUSES)
        self._puts.append(SubtickPackets(self._pace.now_ns(), tick, actions.sent))
        self._subticks.pass_tick(tick, medium, self)
        return replace(actions, sent=SentPackets.none())

    def take_in(self) -> list[SubtickPackets]:
        """The packets that agents sent since the last call."""
        puts, self._puts = self._puts, []
        return puts

    def hand_over(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Deliver packets and statuses within a tick to agents with an `on_receive`."""
        self._backend.receive(received, tx_status)
        sent = self._backend.on_receive(tick, at_ns)
        if len(sent):
            self._puts.append(SubtickPackets(self._pace.now_ns(), None, sent))

    def report(self) -> RealTimeReport:
        """The report of the loop."""
        return report_of(self._pace, self._subticks)


class RealTimeBackend(ZenohBackend[RealTime]):
    """A backend of runners that the loop does not wait for: `RealTime` decides, this class carries the bytes."""

    congestion = zenoh.CongestionControl.DROP  # a runner that reads nothing must not hold up the world

    def __init__(
        self,
        listen: ListenSettings | str,
        run_id: str,
        assignments: list[Assignment],
        timeout_s: float,
        clock: Clock,
        hooks: BackendHooks,
        on_loss: OnLoss,
        pace: Pace,
        watchdog_s: float,
        policy: JoinPolicy,
        subticks: Subticks | None,
    ) -> None:
        registry = RealTime(assignments, watchdog_s, timeout_s, on_loss, policy, subtick=subticks is not None)
        super().__init__(listen, run_id, registry, timeout_s, clock, hooks)
        self._pace, self._assignments, self._subticks = pace, assignments, subticks
        self._rate_hz = assignments[0].rate_hz
        if subticks:
            self._inbox = RunnerInbox(registry.limits, clock.now_ns)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Send a frame to every runner, and return the actions that arrived by the end of the tick."""
        self._send(self._registry.open_tick(tick, self._pace.begin(), readings, received, tx_status))
        self._pace.handed_over(received.received_at_ns)
        self._pace.hold(tick)
        self._take_in()
        return self._registry.take()

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """As `act`, with frames also within the tick, as packets arrive and are due."""
        assert self._subticks
        now_ns = self._pace.begin()
        self.hand_over(tick, tick_start_ns(tick, self._rate_hz), received, tx_status)
        self._pace.handed_over(received.received_at_ns)
        self._subticks.exchange(tick, medium, self)  # first what became due since the last tick's end
        self._send(self._registry.open_tick(tick, now_ns, readings, ReceivedPackets.none(), NO_TX_STATUSES))
        self._subticks.pass_tick(tick, medium, self)
        return self._registry.take()

    def take_in(self) -> list[SubtickPackets]:
        """The packets that arrived from runners since the last call."""
        self._take_in()
        return self._registry.puts()

    def hand_over(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Send a frame to every runner whose robots have new packets or statuses."""
        self._send(self._registry.hand_over(tick, at_ns, received, tx_status))

    def report(self) -> RealTimeReport:
        """The report of the loop and of the runners."""
        registry = self._registry
        return replace(
            report_of(self._pace, self._subticks),
            late_answers=self._by_robot(registry.late),
            watchdog_stops=self._by_robot(registry.watchdog_stops),
            frames_dropped=registry.frames_dropped,
            packets_dropped=registry.packets_dropped,
            tx_status_dropped=registry.tx_status_dropped,
        )

    def _handle(self, item: Item) -> None:
        self._registry.now_ns = self._inbox.arrived_ns
        super()._handle(item)

    def _by_robot(self, counts: IntArray) -> dict[str, int]:
        """The non-zero counts, by robot."""
        groups = [group for assignment in self._assignments for group in assignment.groups]
        pairs = [pair for group in groups for pair in zip(group.robot_names, counts[group.rows].tolist(), strict=True)]
        return {name: count for name, count in pairs if count}
