"""Checks for agents: two classes implement the same rule, or the rows of a VectorAgent are independent.

Both run the same robots twice with synthetic inputs, through the agent groups that run everywhere, and compare the
actions bit for bit. `inputs` yields the synthetic inputs tick by tick, keyed by a seed.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from swarmwire.agent.agent import Agent, AgentClass
from swarmwire.agent.agent_group import AgentGroup, agent_group
from swarmwire.agent.step_context import StepTime
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.base import draws
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.sentinels import BROADCAST, NO_TX_STATUS
from swarmwire.comms.robot.bodies.body import Body, load_body
from swarmwire.comms.robot.messages import DICT_TAG, decode_dict, message_classes
from swarmwire.comms.robot.packets import (
    NO_TX_STATUSES,
    TAG_BYTES,
    Payloads,
    ReceivedPackets,
    SentPackets,
    TxResult,
    TxStatuses,
)
from swarmwire.comms.robot.tick_io import Actions, GroupReadings
from swarmwire.comms.wire.assignment import GroupAssignment, params_of

__all__ = ["Trial", "assert_equivalent", "assert_rows_independent"]

Action = tuple[int, str, str]  # robot, name of the action, and its exact value
MAX_SHOWN = 8  # actions of a robot in a message
SPEEDS = ("linear_mps", "angular_radps", "lateral_mps")
RATE_HZ = 10
MEASURES = ("range_m", "bearing_rad", "rssi_dbm")
DROP_OUT_SHARE = 0.1  # share of the robots missing in a tick
RECEPTION_SHARE = 0.4  # share of the senders that a robot receives
STATUS_SHARE = 0.6  # share of the outstanding tx statuses that arrive in a tick


@dataclass(frozen=True)
class Trial:
    """A test case for an agent: robots with synthetic readings and packets.

    All readings are drawn again in each tick. A packet is received a tick later, by each of the others with probability
    0.4, and an agent that needs tx statuses gets all kinds of them. A tenth of the robots is missing in each tick and
    starts with defaults when it returns.
    """

    robots: int = 7  #: size of the group
    ticks: int = 12  #: a tenth of a second each
    seed: int = 1  #: for readings, reception and the robots' draws
    body: str | Body = "epuck"  #: the name of a bundled body, or any body
    params: dict[str, Any] | None = None  #: those of a scenario: a list has a value for each robot

    @cached_property
    def spec(self) -> Body:
        """The body with its specs."""
        return load_body(self.body) if isinstance(self.body, str) else self.body


class SyntheticInputs(NamedTuple):
    """The inputs of a group in a tick."""

    time: StepTime
    readings: GroupReadings
    received: ReceivedPackets
    tx_status: TxStatuses


def actions_of(actions: Actions, body: Body) -> dict[int, dict[str, str]]:
    """Return the exact value of each action, by robot row and name of the action."""
    by_robot: dict[int, dict[str, str]] = {robot: {} for robot in actions.rows.tolist()}
    for robot, name, value in chain(_driven(actions), _shown(actions), _actuated(actions, body), _sent(actions.sent)):
        by_robot[robot][name] = value
    return by_robot


def _driven(actions: Actions) -> Iterator[Action]:
    for name in SPEEDS:
        speeds: list[float] = getattr(actions, name).tolist()
        for robot, drives, speed in zip(actions.rows.tolist(), actions.drive.tolist(), speeds, strict=True):
            if drives:
                yield robot, f"drive: {name}", repr(speed)


def _shown(actions: Actions) -> Iterator[Action]:
    notes, leds = actions.notes, actions.leds
    for robot, index in zip(notes.rows.tolist(), notes.value.tolist(), strict=True):
        yield robot, "note", repr(notes.names[int(index)])
    for robot, value in zip(actions.values.rows.tolist(), actions.values.value.tolist(), strict=True):
        yield robot, "note: value", repr(value)
    for robot, led, rgb in zip(leds.rows.tolist(), leds.slot.tolist(), leds.integers.tolist(), strict=True):
        yield robot, f"led {led}", f"0x{rgb:06x}"


def _actuated(actions: Actions, body: Body) -> Iterator[Action]:
    slots = [f"{name}[{index}]" for name, spec in body.actuators.items() for index in range(spec.width)]
    table = actions.actuators
    for robot, slot, number in zip(table.rows.tolist(), table.slot.tolist(), table.value.tolist(), strict=True):
        yield robot, f"actuate: {slots[slot]}", repr(number)


def _sent(sent: SentPackets) -> Iterator[Action]:
    packets: dict[int, int] = {}  # number of packets so far, by robot
    columns = sent.sender.tolist(), sent.to.tolist(), sent.tx_status_ids.tolist()
    for index, (robot, to, tx_status_id) in enumerate(zip(*columns, strict=True)):
        number = packets[robot] = packets.get(robot, 0) + 1
        yield robot, f"packet {number}: to", "all" if to == BROADCAST else f"robot {to}"
        if tx_status_id != NO_TX_STATUS:
            yield robot, f"packet {number}: id", str(tx_status_id)
        for name, value in _fields(sent.payloads.row(index)):
            yield robot, f"packet {number}: {name}", value


def _fields(payload: bytes) -> list[tuple[str, str]]:
    tag = int.from_bytes(payload[:TAG_BYTES], "little")
    if tag == DICT_TAG:
        return [("dict", repr(decode_dict(payload)))]
    for kind in message_classes():
        if (kind.tag, kind.size_bytes) == (tag, len(payload)):
            message = kind.decode(payload)
            values = [(f"{kind.__name__}.{name}", repr(getattr(message, name))) for name in kind.ranges]
            return values or [(kind.__name__, "sent")]
    return [("bytes", payload.hex(" "))]


@dataclass(frozen=True)
class Comparison:
    """Compares the actions of two agents with the same inputs."""

    text: str  # start of the message if they differ
    names: tuple[str, str]
    body: Body

    def check(self, tick: int, first: Actions, second: Actions) -> None:
        """Raise AssertionError with the first robot whose actions differ, and its actions in both."""
        actions, other_actions = actions_of(first, self.body), actions_of(second, self.body)
        different = [robot for robot in actions if actions[robot] != other_actions[robot]]
        if different:
            robot, *others = different
            lines = [f"{self.text} in tick {tick}, robot {robot}:", *self._lines(actions[robot], other_actions[robot])]
            if others:
                lines.append(f"and so do robots {', '.join(map(str, others))}")
            raise AssertionError("\n".join(lines))

    def _lines(self, actions: dict[str, str], other_actions: dict[str, str]) -> list[str]:
        first, second = self.names
        different = [name for name in actions | other_actions if actions.get(name) != other_actions.get(name)]
        lines = [
            f"  {name}: {actions.get(name, 'nothing')} ({first}), {other_actions.get(name, 'nothing')} ({second})"
            for name in different[:MAX_SHOWN]
        ]
        return lines + [f"  and {len(different) - MAX_SHOWN} more"] * (len(different) > MAX_SHOWN)


def assert_equivalent(single: type[Agent], vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """Raise AssertionError unless both act alike, bit for bit, with the same readings and packets.

    The message names the tick, a robot, and each number, LED, note and field of a message in which the two differ.
    """
    trial = trial or Trial()
    single_group, vector_group = (_group(kind, trial, np.arange(trial.robots)) for kind in (single, vector))
    names = single.__name__, vector.__name__
    comparison = Comparison(f"{single.__name__} and {vector.__name__} differ", names, trial.spec)
    for tick, (tick_inputs, show) in enumerate(inputs(trial)):
        actions = single_group.act(*tick_inputs)
        comparison.check(tick, actions, vector_group.act(*tick_inputs))
        show(actions.sent)


def assert_rows_independent(vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """Raise AssertionError unless n rows at once act like each row alone, bit for bit: no row reads another."""
    trial = trial or Trial()
    together = _group(vector, trial, np.arange(trial.robots))
    alone = [_group(vector, trial, np.array([row])) for row in range(trial.robots)]
    comparison = Comparison(f"rows of {vector.__name__} are not independent", ("together", "alone"), trial.spec)
    for tick, (tick_inputs, show) in enumerate(inputs(trial)):
        actions = together.act(*tick_inputs)
        row_actions = [group.act(*_inputs_of_row(row, tick_inputs)) for row, group in enumerate(alone)]
        comparison.check(tick, actions, Actions.joined(row_actions))
        show(actions.sent)


def _group(kind: AgentClass, trial: Trial, rows: IntArray) -> AgentGroup:
    keys = np.array([draws.derive_key("trial", trial.seed, int(row)) for row in rows], np.uint64)
    names = tuple(f"robot-{row}" for row in rows)
    params = params_of(trial.params or {}, rows)
    return agent_group(GroupAssignment("trial", "", params, trial.spec, rows, names, keys), kind)


def _inputs_of_row(row: int, tick_inputs: SyntheticInputs) -> SyntheticInputs:
    """Return the inputs of one row."""
    time, readings, received, tx_status = tick_inputs
    index = np.flatnonzero(readings.rows == row)
    return SyntheticInputs(
        time,
        GroupReadings(readings.rows[index], {name: column[index] for name, column in readings.fields.items()}),
        received.select(np.flatnonzero(received.receiver == row)),
        tx_status.select(np.flatnonzero(tx_status.row == row)),
    )


class _Medium:
    """Delivers the packets of the last tick at random, and their tx statuses at random ticks."""

    def __init__(self, key: int) -> None:
        self._key, self._sent = key, SentPackets.none()
        self._outstanding = NO_TX_STATUSES

    def show(self, sent: SentPackets) -> None:
        self._sent = sent.select(np.argsort(sent.sender, kind="stable"))
        unicast = np.flatnonzero(self._sent.tx_status_ids != NO_TX_STATUS)
        row, id_ = self._sent.sender[unicast], self._sent.tx_status_ids[unicast]
        chance = draws.uniform(self._key, row, id_, 0, draws.purpose("outcome"))
        new = TxStatuses(row, id_, (chance * len(TxResult)).astype(np.int64))
        self._outstanding = TxStatuses.joined([self._outstanding, new])

    def tx_status(self, tick: int) -> TxStatuses:
        """Return statuses, like the radio medium also for missing robots and for those that started again since."""
        arrives = _uniform(self._key, tick, "learning", (len(self._outstanding),)) < STATUS_SHARE
        arriving, self._outstanding = (self._outstanding.select(np.flatnonzero(mask)) for mask in (arrives, ~arrives))
        return arriving

    def received(self, tick: int, rows: IntArray) -> ReceivedPackets:
        chance = _uniform(self._key, tick, "hearing", (len(rows), len(self._sent)))
        receiver, payload = np.nonzero((chance < RECEPTION_SHARE) & (self._sent.sender != rows[:, None]))
        measured = {name: _uniform(self._key, tick, name, (len(receiver),)) * 3.0 - 1.0 for name in MEASURES}
        at_ns = np.full(len(receiver), tick_start_ns(tick, RATE_HZ) - 1, np.int64)
        sender = self._sent.sender[payload]
        payloads: Payloads = self._sent.payloads
        return ReceivedPackets(rows[receiver], sender, np.full(len(receiver), tick), at_ns, measured, payload, payloads)


def inputs(trial: Trial) -> Iterator[tuple[SyntheticInputs, Callable[[SentPackets], None]]]:
    """Yield the inputs of the robots tick by tick, each with a function that accepts the packets that they send."""
    key, body = draws.derive_key("inputs", trial.seed), trial.spec
    medium = _Medium(key)
    for tick in range(trial.ticks):
        rows = np.flatnonzero(_uniform(key, tick, "drop-out", (trial.robots,)) >= DROP_OUT_SHARE)
        time_ns = tick_start_ns(tick, RATE_HZ)
        time = StepTime(tick, time_ns, tick_start_ns(tick + 1, RATE_HZ) - time_ns)
        readings = GroupReadings(rows, _readings(body, key, tick, rows))
        yield SyntheticInputs(time, readings, medium.received(tick, rows), medium.tx_status(tick)), medium.show


def _readings(body: Body, key: int, tick: int, rows: IntArray) -> dict[str, FloatArray]:
    n = len(rows)

    def draw(purpose: str, width: int) -> FloatArray:
        return _uniform(key, tick, purpose, (n, width) if width else (n,))

    readings: dict[str, FloatArray] = {}
    for name, spec in body.sensors.items():
        columns = zip(spec.reading_fields(), spec.synthetic(name, tick, draw), strict=True)
        readings |= {f"{name}.{field.name}": column for field, column in columns}
    return readings


def _uniform(key: int, tick: int, purpose: str, shape: tuple[int, ...]) -> FloatArray:
    count = np.arange(int(np.prod(shape))).reshape(shape)
    return draws.uniform(key, tick, count, 0, draws.purpose(purpose))
