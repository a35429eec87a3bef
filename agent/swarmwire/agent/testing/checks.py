"""The checks themselves: the same robots twice, in two ways, and what they do compared."""

from typing import Any

import numpy as np

from swarmwire.agent.agent import Agent
from swarmwire.agent.host import Hosted, hosted
from swarmwire.agent.loading import AgentClass
from swarmwire.agent.testing.comparison import Comparison
from swarmwire.agent.testing.made_up import Given, inputs
from swarmwire.agent.testing.trial import Trial
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms import draws
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import GroupAssignment, params_of
from swarmwire.comms.tick_io import Actions, GroupSenses


def assert_equivalent(single: type[Agent], vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """AssertionError unless both do exactly the same, bit for bit, for robots that sense and hear the same.

    It names the tick, a robot, and each number, LED, note and field of a message in which the two differ.
    """
    trial = trial or Trial()
    one, other = (_host(kind, trial, np.arange(trial.robots)) for kind in (single, vector))
    names = single.__name__, vector.__name__
    comparison = Comparison(f"{single.__name__} and {vector.__name__} differ", names, trial.sheet)
    for tick, (given, show) in enumerate(inputs(trial)):
        first = one.act(*given)
        comparison.check(tick, first, other.act(*given))
        show(first.sent)


def assert_rows_independent(vector: type[VectorAgent[Any]], trial: Trial | None = None) -> None:
    """AssertionError unless n rows at once do exactly what each row does alone, bit for bit: so no row peeks."""
    trial = trial or Trial()
    together = _host(vector, trial, np.arange(trial.robots))
    alone = [_host(vector, trial, np.array([row])) for row in range(trial.robots)]
    comparison = Comparison(f"rows of {vector.__name__} are not independent", ("together", "alone"), trial.sheet)
    for tick, (given, show) in enumerate(inputs(trial)):
        first = together.act(*given)
        comparison.check(tick, first, Actions.joined([host.act(*_only(row, given)) for row, host in enumerate(alone)]))
        show(first.sent)


def _host(kind: AgentClass, trial: Trial, rows: IntArray) -> Hosted:
    keys = np.array([draws.derive_key("trial", trial.seed, int(row)) for row in rows], np.uint64)
    names = tuple(f"robot-{row}" for row in rows)
    params = params_of(trial.params or {}, rows)
    return hosted(GroupAssignment("trial", "", params, trial.sheet, rows, names, keys), kind)


def _only(row: int, given: Given) -> Given:
    at = np.flatnonzero(given.senses.rows == row)
    own = GroupSenses(given.senses.rows[at], {name: column[at] for name, column in given.senses.fields.items()})
    heard = given.heard.select(np.flatnonzero(given.heard.receiver == row))
    return Given(given.time, own, heard, given.outcomes.select(np.flatnonzero(given.outcomes.row == row)))
