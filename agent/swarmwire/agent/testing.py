"""Checks for agents, ours and users': two agents that are the same rule, and rows that do not see one another.

Both feed made-up ticks (`made_up_ticks`), keyed by a seed, through the same host that runs agents anywhere.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.agent.agent import Agent
from swarmwire.agent.host import Hosted, hosted
from swarmwire.agent.loading import AgentClass
from swarmwire.agent.made_up_ticks import Given, made_up_ticks
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms import draws
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import GroupAssignment, params_of
from swarmwire.comms.bodies.body import Body, load_body
from swarmwire.comms.packets import Sent
from swarmwire.comms.senses import Actions, GroupSenses


@dataclass(frozen=True)
class Trial:
    """What to try an agent with."""

    robots: int = 7
    ticks: int = 12
    seed: int = 1
    body: str | Body = "epuck"  # one that comes with swarmwire, or any other
    params: dict[str, Any] | None = None  # a list has a value for each robot


def assert_equivalent(single: type[Agent], vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """AssertionError unless both do exactly the same, bit for bit, for robots that sense and hear the same."""
    trial = trial or Trial()
    one, other = (_host(kind, trial, np.arange(trial.robots)) for kind in (single, vector))
    for given, show in _ticks(trial):
        first, second = one.act(*given), other.act(*given)
        names = f"{single.__name__} and {vector.__name__}"
        _assert_same(first, second, f"{names} differ in tick {given.time[0]}")
        show(first.sent)


def assert_rows_independent(vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """AssertionError unless n rows at once do exactly what each row does alone, bit for bit: so no row peeks."""
    trial = trial or Trial()
    together = _host(vector, trial, np.arange(trial.robots))
    alone = [_host(vector, trial, np.array([row])) for row in range(trial.robots)]
    for given, show in _ticks(trial):
        at_once = together.act(*given)
        each = [host.act(*_only(row, given)) for row, host in enumerate(alone)]
        text = f"rows of {vector.__name__} are not independent in tick {given.time[0]}"
        _assert_same(at_once, Actions.joined(each), text)
        show(at_once.sent)


def _body(trial: Trial) -> Body:
    return load_body(trial.body) if isinstance(trial.body, str) else trial.body


def _ticks(trial: Trial) -> Iterator[tuple[Given, Callable[[Sent], None]]]:
    return made_up_ticks(_body(trial), trial.robots, trial.ticks, trial.seed)


def _host(kind: AgentClass, trial: Trial, rows: IntArray) -> Hosted:
    keys = np.array([draws.derive_key("trial", trial.seed, int(row)) for row in rows], np.uint64)
    names = tuple(f"robot-{row}" for row in rows)
    params = params_of(trial.params or {}, rows)
    group = GroupAssignment("trial", "", params, _body(trial), rows, names, keys)
    return hosted(group, kind)


def _only(row: int, given: Given) -> Given:
    at = np.flatnonzero(given.senses.rows == row)
    own = GroupSenses(given.senses.rows[at], {name: column[at] for name, column in given.senses.fields.items()})
    heard = given.heard.select(np.flatnonzero(given.heard.receiver == row))
    return Given(given.time, own, heard, given.outcomes.select(np.flatnonzero(given.outcomes.row == row)))


def _assert_same(first: Actions, second: Actions, text: str) -> None:
    for name in ("rows", "drive", "linear_mps", "angular_radps", "lateral_mps"):
        one, other = getattr(first, name), getattr(second, name)
        if not np.array_equal(one, other, equal_nan=name not in ("rows", "drive")):
            raise AssertionError(f"{text}: {name}\n{one}\n{other}")
    if _states(first) != _states(second):
        raise AssertionError(f"{text}: states\n{_states(first)}\n{_states(second)}")
    if _leds(first) != _leds(second):
        raise AssertionError(f"{text}: leds\n{_leds(first)}\n{_leds(second)}")
    if _actuations(first) != _actuations(second):
        raise AssertionError(f"{text}: actuators\n{_actuations(first)}\n{_actuations(second)}")
    if _packets(first.sent) != _packets(second.sent):
        raise AssertionError(f"{text}: packets\n{_packets(first.sent)}\n{_packets(second.sent)}")


def _states(actions: Actions) -> dict[int, str]:
    notes = actions.notes
    return {int(row): notes.names[code] for row, code in zip(notes.rows, notes.code, strict=True)}


def _leds(actions: Actions) -> dict[tuple[int, int], int]:
    """The colours that LEDs were switched to, by robot and LED."""
    rows, which, rgb = actions.leds.rows.tolist(), actions.leds.which.tolist(), actions.leds.rgb.tolist()
    return dict(zip(zip(rows, which, strict=True), rgb, strict=True))


def _actuations(actions: Actions) -> dict[tuple[int, int], float]:
    """What own actuators were set to, by robot and place."""
    rows, place, value = actions.own.rows.tolist(), actions.own.place.tolist(), actions.own.value.tolist()
    return dict(zip(zip(rows, place, strict=True), value, strict=True))


def _packets(sent: Sent) -> list[tuple[int, int, int, bytes]]:
    of = sent.select(np.argsort(sent.sender, kind="stable"))
    numbers = zip(of.sender.tolist(), of.to.tolist(), of.outcome_ids.tolist(), strict=True)
    return [(*three, of.payloads.row(i)) for i, three in enumerate(numbers)]
