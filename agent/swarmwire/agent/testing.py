"""Checks for agents: two classes implement the same rule, or the rows of a VectorAgent are independent.

Both run the same robots twice, in two ways, with synthetic inputs through the host that runs agents anywhere, and
compare the actions bit for bit.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from swarmwire.agent.agent import Agent, AgentClass
from swarmwire.agent.host import AgentGroup, agent_group
from swarmwire.agent.synthetic_inputs import SyntheticInputs, Trial, inputs
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms import draws
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import GroupAssignment, params_of
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.messages import DICT_TAG, decode_dict, message_classes
from swarmwire.comms.packets import BROADCAST, NOT_MEASURED, TAG_BYTES, SentPackets
from swarmwire.comms.tick_io import Actions, GroupReadings

__all__ = ["Trial", "assert_equivalent", "assert_rows_independent"]

Action = tuple[int, str, str]  # robot, name of the action, and its exact value
MAX_SHOWN = 8  # actions of a robot in a message
SPEEDS = ("linear_mps", "angular_radps", "lateral_mps")


def actions_of(actions: Actions, body: Body) -> dict[int, dict[str, str]]:
    """The actions of each robot, by its row: the exact value of each action, by its name."""
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
    for robot, which, rgb in zip(leds.rows.tolist(), leds.place.tolist(), leds.integers.tolist(), strict=True):
        yield robot, f"led {which}", f"0x{rgb:06x}"


def _actuated(actions: Actions, body: Body) -> Iterator[Action]:
    places = [f"{name}[{at}]" for name, spec in body.actuators.items() for at in range(spec.width)]
    table = actions.actuators
    for robot, at, number in zip(table.rows.tolist(), table.place.tolist(), table.value.tolist(), strict=True):
        yield robot, f"actuate: {places[at]}", repr(number)


def _sent(sent: SentPackets) -> Iterator[Action]:
    packets: dict[int, int] = {}  # of each robot so far
    columns = sent.sender.tolist(), sent.to.tolist(), sent.tx_status_ids.tolist()
    for at, (robot, to, tx_status_id) in enumerate(zip(*columns, strict=True)):
        number = packets[robot] = packets.get(robot, 0) + 1
        yield robot, f"packet {number}: to", "all" if to == BROADCAST else f"robot {to}"
        if tx_status_id != NOT_MEASURED:
            yield robot, f"packet {number}: id", str(tx_status_id)
        for name, value in _fields(sent.payloads.row(at)):
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
        """AssertionError with the first robot whose actions differ, and its actions in both."""
        one, other = actions_of(first, self.body), actions_of(second, self.body)
        different = [robot for robot in one if one[robot] != other[robot]]
        if different:
            robot, *others = different
            lines = [f"{self.text} in tick {tick}, robot {robot}:", *self._lines(one[robot], other[robot])]
            if others:
                lines.append(f"and so do robots {', '.join(map(str, others))}")
            raise AssertionError("\n".join(lines))

    def _lines(self, one: dict[str, str], other: dict[str, str]) -> list[str]:
        first, second = self.names
        different = [name for name in one | other if one.get(name) != other.get(name)]
        lines = [
            f"  {name}: {one.get(name, 'nothing')} ({first}), {other.get(name, 'nothing')} ({second})"
            for name in different[:MAX_SHOWN]
        ]
        return lines + [f"  and {len(different) - MAX_SHOWN} more"] * (len(different) > MAX_SHOWN)


def assert_equivalent(single: type[Agent], vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """AssertionError unless both act exactly alike, bit for bit, tick_inputs the same readings and packets.

    It names the tick, a robot, and each number, LED, note and field of a message in which the two differ.
    """
    trial = trial or Trial()
    one, other = (_host(kind, trial, np.arange(trial.robots)) for kind in (single, vector))
    names = single.__name__, vector.__name__
    comparison = Comparison(f"{single.__name__} and {vector.__name__} differ", names, trial.spec)
    for tick, (tick_inputs, show) in enumerate(inputs(trial)):
        first = one.act(*tick_inputs)
        comparison.check(tick, first, other.act(*tick_inputs))
        show(first.sent)


def assert_rows_independent(vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """AssertionError unless n rows at once act exactly as each row alone, bit for bit: no row reads another."""
    trial = trial or Trial()
    together = _host(vector, trial, np.arange(trial.robots))
    alone = [_host(vector, trial, np.array([row])) for row in range(trial.robots)]
    comparison = Comparison(f"rows of {vector.__name__} are not independent", ("together", "alone"), trial.spec)
    for tick, (tick_inputs, show) in enumerate(inputs(trial)):
        first = together.act(*tick_inputs)
        comparison.check(
            tick, first, Actions.joined([host.act(*_only(row, tick_inputs)) for row, host in enumerate(alone)])
        )
        show(first.sent)


def _host(kind: AgentClass, trial: Trial, rows: IntArray) -> AgentGroup:
    keys = np.array([draws.derive_key("trial", trial.seed, int(row)) for row in rows], np.uint64)
    names = tuple(f"robot-{row}" for row in rows)
    params = params_of(trial.params or {}, rows)
    return agent_group(GroupAssignment("trial", "", params, trial.spec, rows, names, keys), kind)


def _only(row: int, tick_inputs: SyntheticInputs) -> SyntheticInputs:
    """The inputs of one row."""
    time, readings, received, tx_status = tick_inputs
    at = np.flatnonzero(readings.rows == row)
    return SyntheticInputs(
        time,
        GroupReadings(readings.rows[at], {name: column[at] for name, column in readings.fields.items()}),
        received.select(np.flatnonzero(received.receiver == row)),
        tx_status.select(np.flatnonzero(tx_status.row == row)),
    )
