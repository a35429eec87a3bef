"""One group of robots and its gateway: rows of the loop on one side, places in the group on the other."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.interfaces import ReceivingBackend, SubtickMedium, SubtickPackets
from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, LedChanges, Readings
from swarmwire.comms.truth import Group
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.realtime_backend import RealTimeReport, report_of
from swarmwire.world.gateways.gateway import Gateway
from swarmwire.world.subtick import Subticks


class GatewayGroup:
    """The robots of a group of a run's only arena, behind a gateway.

    Attributes:
        name: of the group.
        kind: of the gateway.
        rows: (n,) robot rows.
        gateway: where they answer.
        driven: (n,) bool, which of them some program has told how to move.
    """

    def __init__(self, group: Group, kind: str, gateway: Gateway) -> None:
        self.name, self.kind, self.gateway = group.name, kind, gateway
        self.rows = np.arange(group.start, group.stop)
        self.driven = np.zeros(len(self.rows), np.bool_)
        self._alive = self._minds = np.ones(len(self.rows), np.bool_)
        self._told: dict[str, FloatArray] = {}  # the newest readings, of the dead those before their death

    def publish(self, time_ns: int, readings: Readings) -> None:
        """Hand the newest readings to the gateway; who senses nothing in a tick in which its group acts is dead."""
        if self.name not in readings:  # it does not act in this tick
            return
        own = readings[self.name]
        place = own.rows - self.rows[0]
        alive = np.zeros(len(self.rows), np.bool_)
        alive[place] = True
        # One that dies or is revived comes to rest by itself, which no program told it.
        self._minds, self._alive = alive & self._alive, alive
        self._told = {field: self._whole(field, place, column) for field, column in own.fields.items()}
        self.gateway.publish(time_ns, self._told, alive)

    def take(self) -> Actions:
        """What foreign programs told the robots since it was asked last."""
        told = self.gateway.take()
        self.driven |= told.drive & self._minds
        leds = LedChanges(told.leds.rows + self.rows[0], told.leds.which, told.leds.rgb)
        return Actions(self.rows, told.drive, told.linear_mps, told.angular_radps, told.lateral_mps, leds=leds)

    def _whole(self, field: str, place: IntArray, column: FloatArray) -> FloatArray:
        """A row for each robot, also the dead: a new array, since the gateway may still read the last one."""
        if len(place) == len(self.rows):
            return column
        whole = self._told[field].copy() if field in self._told else np.zeros((len(self.rows), *column.shape[1:]))
        whole[place] = column
        return whole


# --- The backend of a run some of whose robots answer as real ones: foreign programs drive them, and nobody waits for
# those.
#
#     a tick begins     poses, readings and packets received go out
#     it is over        by the wall clock: commands and packets that have come by then are taken
#
# So what is commanded while a tick goes on is done from its start, like the answers of runners in real time.
#
# A loop that lags by more than a tick does not make up for it: robots that moved for seconds in an instant, by commands
# of before, would be none that a program could drive.


CARRIED = ("packets_to_robots", "packets_from_robots")  # which is no fault


class RobotsRadio(Protocol):
    """The world's air as robots behind gateways have it; `RadioBridge` is one."""

    def publish(self, tick: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Hand out what these robots received, and learn of packets that they sent."""
        ...

    def take(self) -> SentPackets:
        """The packets that they sent since it was asked last."""
        ...

    def counts(self) -> dict[str, int]:
        """What went wrong on the way, by name."""
        ...


class GatewayBackend:
    """The robots of some groups behind gateways, all others behind another backend, in one arena and real time."""

    def __init__(
        self,
        inner: ReceivingBackend,
        groups: Sequence[GatewayGroup],
        medium: RobotsRadio | None,
        pace: Pace,
        rate_hz: int,
        show: Callable[[], None] = lambda: None,
        show_counts: Callable[[], dict[str, int]] = dict,
        subticks: Subticks | None = None,
    ) -> None:
        """`inner` plays all other groups; `show` is called at the start of each tick, before anything goes out.

        `show_counts` tells what went wrong there, by name. Gateways and air are open already, and are closed by
        whoever opened them.
        """
        self._inner, self._groups, self._medium, self._pace, self._show = inner, groups, medium, pace, show
        self._rate_hz, self._show_counts, self._subticks = rate_hz, show_counts, subticks
        self._puts: list[SubtickPackets] = []
        self._names = frozenset(group.name for group in groups)
        self._rows = np.sort(np.concatenate([group.rows for group in groups]))
        self.start, self.close = inner.start, inner.close

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """What agents here decided, and what foreign programs told the other robots in this tick."""
        others = self._begin(tick, readings, received, tx_status)
        actions = self._inner.act(tick, others, received, tx_status)
        self._pace.hold(tick)
        self._catch_up(tick)
        told = Actions.joined([actions, *(group.take() for group in self._groups)])
        return replace(told, sent=SentPackets.joined([told.sent, self._medium.take()])) if self._medium else told

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """The same, with packets taken when they come and handed over when they are due."""
        assert self._subticks
        others = self._begin(tick, readings, received, tx_status)
        self._inner.receive(received, tx_status)
        actions = self._inner.act(tick, others, ReceivedPackets.none(tuple(received.given)), NO_TX_STATUSES)
        self._puts.append(SubtickPackets(self._pace.now_ns(), tick, actions.sent))
        self._subticks.pass_tick(tick, medium, self)
        self._catch_up(tick)
        still = replace(actions, sent=SentPackets.none())
        return Actions.joined([still, *(group.take() for group in self._groups)])

    def take_in(self) -> list[SubtickPackets]:
        """What agents here sent since the last call, and what came from foreign ones."""
        puts, self._puts = self._puts, []
        return [*puts, SubtickPackets(self._pace.now_ns(), None, self._medium.take())] if self._medium else puts

    def hand_over(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Tell robots behind gateways, and let agents here that read between ticks read."""
        self._publish(tick, received, tx_status)
        self._inner.receive(received, tx_status)
        sent = self._inner.on_receive(tick, at_ns)
        if len(sent):
            self._puts.append(SubtickPackets(self._pace.now_ns(), None, sent))

    def counts(self) -> dict[str, int]:
        """Faults of the inner backend, of gateways by their kind, of what is shown, and of the medium between."""
        found = Counter(self._inner.counts())
        found.update(self._show_counts())
        for group in self._groups:
            found.update({f"{group.kind}_{name}": count for name, count in group.gateway.counts().items()})
        if self._medium:
            found.update({f"air_{name}": count for name, count in self._medium.counts().items() if name not in CARRIED})
        return {name: count for name, count in found.items() if count}

    def report(self) -> RealTimeReport:
        """How far the loop kept up."""
        return report_of(self._pace, self._subticks)

    def _begin(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> Readings:
        """A tick begins: all goes out; what the others sense."""
        self._pace.begin()
        self._show()
        for group in self._groups:
            group.publish(tick_start_ns(tick, self._rate_hz), readings)
        self._publish(tick, received, tx_status)
        self._pace.handed_over(received.received_at_ns)
        return {name: of for name, of in readings.items() if name not in self._names}

    def _publish(self, tick: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        if self._medium:
            self._medium.publish(
                tick, received.select(self._own(received.receiver)), tx_status.select(self._own(tx_status.row))
            )

    def _catch_up(self, tick: int) -> None:
        """Where the loop lags by more than a tick, the schedule begins anew."""
        pace = self._pace
        if pace.lag_ns > tick_start_ns(1, self._rate_hz) / pace.factor:
            pace.begin_anew(tick + 1, pace.factor)

    def _own(self, rows: IntArray) -> IntArray:
        """Which of these rows (k,) are of robots behind gateways."""
        mine: BoolArray = np.isin(rows, self._rows)
        return np.flatnonzero(mine)
