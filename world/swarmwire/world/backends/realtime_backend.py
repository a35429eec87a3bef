"""Real-time backends: each `act` returns when its tick ends by the wall clock, with the answers so far.

`PacedBackend` paces a backend in this process. `RealTimeBackend` connects runners over zenoh. `RealTimeReport`
describes the lag behind the wall clock.
"""

# pyright: reportUnknownMemberType=false

from dataclasses import dataclass, field, replace

import zenoh

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.clock import tick_start_ns, to_s
from swarmwire.comms.observe.interfaces import ReceivingBackend, SubtickMedium, SubtickPackets
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.world.backends.inbox import Item, RunnerInbox
from swarmwire.world.backends.join_policy import ListenSettings
from swarmwire.world.backends.pacing import LatencySummary, Pace
from swarmwire.world.backends.realtime import RealTime
from swarmwire.world.backends.zenoh_backend import BackendHooks, ZenohBackend
from swarmwire.world.subtick import Subticks


@dataclass(frozen=True)
class RealTimeReport:
    """Deadlines that a run in real time missed; all 0 and empty if it kept up."""

    factor: float  #: simulated s per s of wall time
    missed_ticks: int  #: ticks that ended before the loop waited for their end, so the next started late
    worst_lag_s: float  #: the greatest lag, wall time
    late_answers: dict[str, int] = field(default_factory=dict[str, int])  #: answers after their tick, by robot
    watchdog_stops: dict[str, int] = field(default_factory=dict[str, int])  #: robot -> number of stops
    frames_dropped: int = 0  #: middleware loss: frames to runners that no agent acted on
    packets_dropped: int = 0  #: packets in these frames: received by the radio, never by the agent
    tx_status_dropped: int = 0  #: transmit statuses in these frames: known to the radio, never to the agent
    subtick_s: float | None = None  #: wall time after which the loop woke within ticks; None: it did not
    delivery: LatencySummary | None = None  #: delivery of packets after their reception by the modelled radio
    tick_jitter: LatencySummary | None = None  #: start of ticks after the planned end of the tick before


def report_of(pace: Pace, subticks: Subticks | None) -> RealTimeReport:
    """Return the report of a loop."""
    return RealTimeReport(
        factor=pace.factor,
        missed_ticks=pace.missed_ticks,
        worst_lag_s=to_s(pace.worst_lag_ns),
        subtick_s=subticks.subtick_s if subticks else None,
        delivery=pace.delivery.summary(),
        tick_jitter=pace.jitter.summary(),
    )


class PacedBackend:
    """A backend in this process, paced by the wall clock: an agent that takes too long makes the loop lag."""

    def __init__(self, backend: ReceivingBackend, pace: Pace, subticks: Subticks | None = None) -> None:
        self._backend, self._pace, self._subticks = backend, pace, subticks
        self._sent: list[SubtickPackets] = []
        self.start, self.counts, self.close = backend.start, backend.counts, backend.close

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Return the actions of all robots in this tick."""
        self._pace.begin()
        self._pace.count_delivered(received.received_at_ns)
        actions = self._backend.act(tick, readings, received, tx_status)
        self._pace.wait(tick)
        return actions

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Act as `act`, and deliver packets when they are due."""
        assert self._subticks
        self._pace.begin()
        self._pace.count_delivered(received.received_at_ns)
        self._backend.receive(received, tx_status)
        actions = self._backend.act(tick, readings, ReceivedPackets.none(tuple(received.measured)), NO_TX_STATUSES)
        self._sent.append(SubtickPackets(self._pace.now_ns(), tick, actions.sent))
        self._subticks.pass_tick(tick, medium, self)
        return replace(actions, sent=SentPackets.none())

    def pop_sent(self) -> list[SubtickPackets]:
        """Remove and return the packets that agents sent."""
        sent, self._sent = self._sent, []
        return sent

    def deliver(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Deliver packets and statuses within a tick to agents with an `on_receive`."""
        self._backend.receive(received, tx_status)
        sent = self._backend.on_receive(tick, at_ns)
        if len(sent):
            self._sent.append(SubtickPackets(self._pace.now_ns(), None, sent))

    def report(self) -> RealTimeReport:
        """Return the report of the loop."""
        return report_of(self._pace, self._subticks)


class RealTimeBackend(ZenohBackend[RealTime]):
    """A backend of runners that the loop does not wait for: `RealTime` decides, this class carries the bytes."""

    congestion = zenoh.CongestionControl.DROP  # a runner that does not read must not block the world

    def __init__(
        self,
        listen: ListenSettings | str,
        run_id: str,
        registry: RealTime,
        timeout_s: float,
        hooks: BackendHooks,
        pace: Pace,
        subticks: Subticks | None,
    ) -> None:
        """`subticks` if the registry has sub-ticks."""
        super().__init__(listen, run_id, registry, timeout_s, pace.clock, hooks)
        self._pace, self._subticks = pace, subticks
        if subticks:
            self._inbox = RunnerInbox(registry.limits, pace.clock.now_ns)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Send a frame to every runner, and return the actions that arrived by the end of the tick."""
        self._send(self._registry.open_tick(tick, self._pace.begin(), readings, received, tx_status))
        self._pace.count_delivered(received.received_at_ns)
        self._pace.wait(tick)
        self._handle_arrived()
        return self._registry.pop_actions()

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Act as `act`, with frames also within the tick, as packets arrive and are due."""
        assert self._subticks
        now_ns = self._pace.begin()
        self.deliver(tick, tick_start_ns(tick, self._registry.rate_hz), received, tx_status)
        self._pace.count_delivered(received.received_at_ns)
        self._subticks.exchange(tick, medium, self)  # packets that became due since the last tick's end
        self._send(self._registry.open_tick(tick, now_ns, readings, ReceivedPackets.none(), NO_TX_STATUSES))
        self._subticks.pass_tick(tick, medium, self)
        return self._registry.pop_actions()

    def pop_sent(self) -> list[SubtickPackets]:
        """Remove and return the packets that arrived from runners."""
        self._handle_arrived()
        return self._registry.pop_sent()

    def deliver(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Send a frame to every runner whose robots have new packets or statuses."""
        self._send(self._registry.deliver(tick, at_ns, received, tx_status))

    def report(self) -> RealTimeReport:
        """Return the report of the loop and of the runners."""
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
        """Return the non-zero counts, by robot."""
        return {name: int(counts[row]) for name, row in self._registry.row_of.items() if counts[row]}
