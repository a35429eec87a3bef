"""The agent backend of a run with gateways: foreign programs drive the robots of some groups, in real time.

`GatewayGroup` connects a group to its gateway: robot rows on one side, indices in the group on the other.
`GatewayBackend` combines these groups with another backend for all other robots. It waits for no program:

    start of a tick   poses, readings and received packets go out
    end of a tick     by the wall clock: commands and packets that have arrived come in

So a command that arrives during a tick applies from its start, like the answers of runners in real time. A loop that
lags by more than a tick does not catch up, since no program could drive robots that move for seconds in an instant.
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
        name: name of the group.
        kind: kind of the gateway.
        rows: (n,) robot rows.
        gateway: the gateway.
        driven: (n,) True for robots with a command from a program.
    """

    def __init__(self, group: Group, kind: str, gateway: Gateway) -> None:
        self.name, self.kind, self.gateway = group.name, kind, gateway
        self.rows = np.arange(group.start, group.stop)
        self.driven = np.zeros(len(self.rows), np.bool_)
        self._alive = self._commanded_alive = np.ones(len(self.rows), np.bool_)
        self._newest: dict[str, FloatArray] = {}  # newest readings; for dead robots, the last before their death

    def publish(self, tick: int, rate_hz: int, readings: Readings) -> None:
        """Pass the newest readings to the gateway; a robot without readings in a tick of its group is dead."""
        if self.name not in readings:  # the group does not act in this tick
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

    def pop_actions(self) -> Actions:
        """Remove and return the commands of foreign programs."""
        commands = self.gateway.pop_commands()
        self.driven |= commands.drive & self._commanded_alive
        first = self.rows[0]
        leds, motors = (replace(table, rows=table.rows + first) for table in (commands.leds, commands.motors))
        speeds = commands.linear_mps, commands.angular_radps, commands.lateral_mps
        return Actions(self.rows, commands.drive, *speeds, leds=leds, motors=motors)

    def _fill_rows(self, field: str, indices: IntArray, column: FloatArray) -> FloatArray:
        """Return a new column with a row per robot, also for dead ones; the gateway may still read the last column."""
        if len(indices) == len(self.rows):
            return column
        filled = self._newest[field].copy() if field in self._newest else np.zeros((len(self.rows), *column.shape[1:]))
        filled[indices] = column
        return filled


class RobotsRadio(Protocol):
    """The radio medium for robots behind gateways, such as `RadioBridge`."""

    def publish(self, tick: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Deliver received packets and transmit statuses to these robots."""
        ...

    def pop_packets(self) -> SentPackets:
        """Remove and return the packets that they sent."""
        ...

    def pop_notes(self) -> tuple[SparseTable, SparseTable]:
        """Remove and return the states and the numbers that their agents noted."""
        ...

    def counts(self) -> dict[str, int]:
        """Return the numbers of faults, by name."""
        ...


class GatewayBackend:
    """The robots of some groups behind gateways, all others behind another backend, in one arena and real time."""

    def __init__(
        self,
        inner: ReceivingBackend,
        groups: Sequence[GatewayGroup],
        medium: RobotsRadio | None,
        pace: Pace,
        show: Callable[[], None],
        show_counts: Callable[[], dict[str, int]],
        subticks: Subticks | None,
    ) -> None:
        """`inner` plays all other groups; `show` is called at the start of each tick, before readings go out.

        `show_counts` returns the numbers of its faults, by name. The caller has opened the gateways and the radio, and
        closes them.
        """
        self._inner, self._groups, self._medium, self._pace, self._show = inner, groups, medium, pace, show
        self._rate_hz, self._show_counts, self._subticks = pace.rate_hz, show_counts, subticks
        self._sent: list[SubtickPackets] = []
        self._names = frozenset(group.name for group in groups)
        self._rows = np.sort(np.concatenate([group.rows for group in groups]))
        self.start, self.close = inner.start, inner.close

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Return the actions of the inner backend's agents and the commands of foreign programs in this tick."""
        others = self._begin(tick, readings, received, tx_status)
        actions = self._inner.act(tick, others, received, tx_status)
        self._pace.wait(tick)
        self._catch_up(tick)
        commands = Actions.joined([actions, *(group.pop_actions() for group in self._groups)])
        if not self._medium:
            return commands
        sent = SentPackets.joined([commands.sent, self._medium.pop_packets()])
        return self._with_notes(replace(commands, sent=sent))

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Act as `act`; packets are sent as they arrive and delivered as they are due."""
        assert self._subticks
        others = self._begin(tick, readings, received, tx_status)
        self._inner.receive(received, tx_status)
        actions = self._inner.act(tick, others, ReceivedPackets.none(tuple(received.measured)), NO_TX_STATUSES)
        self._sent.append(SubtickPackets(self._pace.now_ns(), tick, actions.sent))
        self._subticks.pass_tick(tick, medium, self)
        self._catch_up(tick)
        without_packets = replace(actions, sent=SentPackets.none())
        return self._with_notes(Actions.joined([without_packets, *(group.pop_actions() for group in self._groups)]))

    def pop_sent(self) -> list[SubtickPackets]:
        """Remove and return the packets of agents and of foreign programs."""
        sent, self._sent = self._sent, []
        return [*sent, SubtickPackets(self._pace.now_ns(), None, self._medium.pop_packets())] if self._medium else sent

    def deliver(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Deliver to robots behind gateways, and to agents with an `on_receive`."""
        self._publish(tick, received, tx_status)
        self._inner.receive(received, tx_status)
        sent = self._inner.on_receive(tick, at_ns)
        if len(sent):
            self._sent.append(SubtickPackets(self._pace.now_ns(), None, sent))

    def counts(self) -> dict[str, int]:
        """Return the numbers of faults of the inner backend, of `show`, of gateways by kind, and of the radio."""
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
        """Return the report of the loop."""
        return report_of(self._pace, self._subticks)

    def _with_notes(self, actions: Actions) -> Actions:
        """Add the notes of the agents of robots behind gateways to the actions."""
        if not self._medium:
            return actions
        states, values = self._medium.pop_notes()
        notes = SparseTable.joined([actions.notes, states])
        return replace(actions, notes=notes, values=SparseTable.joined([actions.values, values]))

    def _begin(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> Readings:
        """Begin a tick: publish readings and packets; return the readings of the other groups."""
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
                received.select(self._behind_gateways(received.receiver)),
                tx_status.select(self._behind_gateways(tx_status.row)),
            )

    def _catch_up(self, tick: int) -> None:
        """Restart the schedule if the loop lags by more than a tick."""
        pace = self._pace
        if pace.lag_ns > tick_start_ns(1, self._rate_hz) / pace.factor:
            pace.restart(tick + 1, pace.factor)

    def _behind_gateways(self, rows: IntArray) -> IntArray:
        """Return the indices in `rows` (k,) of robots behind gateways."""
        is_gateway: BoolArray = np.isin(rows, self._rows)
        return np.flatnonzero(is_gateway)
