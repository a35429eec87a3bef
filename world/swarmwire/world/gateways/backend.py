"""The agent backend of a run with gateways: foreign programs drive the robots of some groups, in real time.

`GatewayGroup` connects a group to its gateway: robot rows on one side, indices in the group on the other.
`GatewayBackend` combines these groups with another backend for all other robots. It waits for no program:

    start of a tick   poses, readings and received packets go out
    end of a tick     by the wall clock: commands and packets that have arrived are taken

So a command that arrives during a tick applies from its start, like the answers of runners in real time. A loop that
lags by more than a tick does not catch up: no program could drive robots that move for seconds in an instant.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.observe.interfaces import ReceivingBackend, SubtickMedium, SubtickPackets
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings, SparseTable
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.realtime_backend import RealTimeReport, report_of
from swarmwire.world.gateways.gateway import Gateway
from swarmwire.world.subtick import Subticks

NOT_FAULTS = ("packets_to_robots", "packets_from_robots")  # counts of the radio that are no faults


class GatewayGroup:
    """The robots of a group of a run's only arena, behind a gateway.

    Attributes:
        name: of the group.
        kind: of the gateway.
        rows: (n,) robot rows.
        gateway: the gateway.
        driven: (n,) bool, robots that got a command from a program.
    """

    def __init__(self, group: Group, kind: str, gateway: Gateway) -> None:
        self.name, self.kind, self.gateway = group.name, kind, gateway
        self.rows = np.arange(group.start, group.stop)
        self.driven = np.zeros(len(self.rows), np.bool_)
        self._alive = self._commanded_alive = np.ones(len(self.rows), np.bool_)
        self._newest: dict[str, FloatArray] = {}  # the newest readings, of the dead those before their death

    def publish(self, tick: int, rate_hz: int, readings: Readings) -> None:
        """Pass the newest readings to the gateway; a robot without readings in a tick of its group is dead."""
        if self.name not in readings:  # it does not act in this tick
            return
        group_readings = readings[self.name]
        indices = group_readings.rows - self.rows[0]
        alive = np.zeros(len(self.rows), np.bool_)
        alive[indices] = True
        # The stop of a robot that dies or is revived is no command of a program.
        self._commanded_alive, self._alive = alive & self._alive, alive
        ages = group_readings.ages_ticks
        self._newest = {
            field: self._fill_rows(field, indices, column)
            for field, column in group_readings.fields.items()
            if ages.get(field.partition(".")[0], 0) is not None
        }
        time_ns = tick_start_ns(tick, rate_hz)
        ages_ns = {name: time_ns - tick_start_ns(tick - age, rate_hz) for name, age in ages.items() if age is not None}
        self.gateway.publish(time_ns, self._newest, alive, ages_ns)

    def take(self) -> Actions:
        """The commands of foreign programs since the last call."""
        commands = self.gateway.take()
        self.driven |= commands.drive & self._commanded_alive
        first = self.rows[0]
        leds, motors = (replace(table, rows=table.rows + first) for table in (commands.leds, commands.motors))
        speeds = commands.linear_mps, commands.angular_radps, commands.lateral_mps
        return Actions(self.rows, commands.drive, *speeds, leds=leds, motors=motors)

    def _fill_rows(self, field: str, indices: IntArray, column: FloatArray) -> FloatArray:
        """The column with a row for each robot, also the dead: a new array, the gateway may still read the last one."""
        if len(indices) == len(self.rows):
            return column
        filled = self._newest[field].copy() if field in self._newest else np.zeros((len(self.rows), *column.shape[1:]))
        filled[indices] = column
        return filled


class RobotsRadio(Protocol):
    """The radio medium as robots behind gateways use it; `RadioBridge` is one."""

    def publish(self, tick: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Deliver received packets and transmit statuses to these robots."""
        ...

    def take(self) -> SentPackets:
        """The packets that they sent since the last call."""
        ...

    def noted(self) -> tuple[SparseTable, SparseTable]:
        """The states and the numbers that their agents noted since the last call."""
        ...

    def counts(self) -> dict[str, int]:
        """Faults, by name."""
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
        show: Callable[[], None],
        show_counts: Callable[[], dict[str, int]],
        subticks: Subticks | None,
    ) -> None:
        """`inner` plays all other groups; `show` is called at the start of each tick, before anything goes out.

        `show_counts` returns its faults, by name. Gateways and radio are open already; the caller closes them.
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
        """The actions of the inner backend's agents and the commands of foreign programs in this tick."""
        others = self._begin(tick, readings, received, tx_status)
        actions = self._inner.act(tick, others, received, tx_status)
        self._pace.wait(tick)
        self._catch_up(tick)
        commands = Actions.joined([actions, *(group.take() for group in self._groups)])
        if not self._medium:
            return commands
        return self._with_noted(replace(commands, sent=SentPackets.joined([commands.sent, self._medium.take()])))

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """As `act`, with packets taken as they arrive and delivered as they are due."""
        assert self._subticks
        others = self._begin(tick, readings, received, tx_status)
        self._inner.receive(received, tx_status)
        actions = self._inner.act(tick, others, ReceivedPackets.none(tuple(received.measured)), NO_TX_STATUSES)
        self._puts.append(SubtickPackets(self._pace.now_ns(), tick, actions.sent))
        self._subticks.pass_tick(tick, medium, self)
        self._catch_up(tick)
        without_packets = replace(actions, sent=SentPackets.none())
        return self._with_noted(Actions.joined([without_packets, *(group.take() for group in self._groups)]))

    def pop_sent(self) -> list[SubtickPackets]:
        """The packets of agents and of foreign programs since the last call."""
        puts, self._puts = self._puts, []
        return [*puts, SubtickPackets(self._pace.now_ns(), None, self._medium.take())] if self._medium else puts

    def deliver(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Deliver to robots behind gateways, and to agents with an `on_receive`."""
        self._publish(tick, received, tx_status)
        self._inner.receive(received, tx_status)
        sent = self._inner.on_receive(tick, at_ns)
        if len(sent):
            self._puts.append(SubtickPackets(self._pace.now_ns(), None, sent))

    def counts(self) -> dict[str, int]:
        """Faults of the inner backend, of `show`, of gateways by their kind, and of the radio."""
        counts = Counter(self._inner.counts())
        counts.update(self._show_counts())
        for group in self._groups:
            counts.update({f"{group.kind}_{name}": count for name, count in group.gateway.counts().items()})
        if self._medium:
            counts.update(
                {f"air_{name}": count for name, count in self._medium.counts().items() if name not in NOT_FAULTS}
            )
        return {name: count for name, count in counts.items() if count}

    def report(self) -> RealTimeReport:
        """The report of the loop."""
        return report_of(self._pace, self._subticks)

    def _with_noted(self, actions: Actions) -> Actions:
        """The actions, with what the agents of robots behind gateways noted."""
        if not self._medium:
            return actions
        states, values = self._medium.noted()
        notes = SparseTable.joined([actions.notes, states])
        return replace(actions, notes=notes, values=SparseTable.joined([actions.values, values]))

    def _begin(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> Readings:
        """Begin a tick: publish everything; returns the readings of the other groups."""
        self._pace.begin()
        self._show()
        for group in self._groups:
            group.publish(tick, self._rate_hz, readings)
        self._publish(tick, received, tx_status)
        self._pace.count_delivered(received.received_at_ns)
        return {name: group for name, group in readings.items() if name not in self._names}

    def _publish(self, tick: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        if self._medium:
            self._medium.publish(
                tick,
                received.select(self._gateway_places(received.receiver)),
                tx_status.select(self._gateway_places(tx_status.row)),
            )

    def _catch_up(self, tick: int) -> None:
        """Restart the schedule if the loop lags by more than a tick."""
        pace = self._pace
        if pace.lag_ns > tick_start_ns(1, self._rate_hz) / pace.factor:
            pace.restart(tick + 1, pace.factor)

    def _gateway_places(self, rows: IntArray) -> IntArray:
        """The indices of these rows (k,) that belong to robots behind gateways."""
        is_gateway: BoolArray = np.isin(rows, self._rows)
        return np.flatnonzero(is_gateway)
