"""Average consensus over the radio: what a robot makes of what it hears, and what becomes of all of them."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import Consensus
from swarmwire.agent.behaviours.consensus import Value
from swarmwire.agent.host import agent_group
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.comms.packets import Payloads, ReceivedPackets
from swarmwire.comms.tick_io import GroupReadings
from swarmwire.deploy import run
from tests.support.agent.hosts import group

PAPER = Path(__file__).parents[4] / "scenarios" / "papers" / "scenarios" / "consensus.toml"
FULL, RING = "radio.range_m=3", "radio.range_m=0.8"


def told(*others: float, **params: float) -> float:
    """What a robot comes to that starts with 1 and hears these numbers in its first step."""
    zeros = np.zeros(len(others), np.int64)
    payloads = Payloads.of([Value(value=other).encode() for other in others])
    received = ReceivedPackets(zeros, np.arange(1, len(others) + 1), zeros, zeros, {}, np.arange(len(others)), payloads)
    host = agent_group(group("", [0], body="point", params={"start": 1.0, **params}), Consensus)
    actions = host.act((0, 0, 10**8), GroupReadings(np.zeros(1, np.int64), {}), received)
    (payload,) = (actions.sent.payloads.row(row) for row in range(len(actions.sent)))
    (value,) = actions.values.value.tolist()
    assert Value.decode(payload).value == value  # what it says to others is what it tells
    return value


@pytest.mark.parametrize(("others", "value"), [((), 1.0), ((2.0,), 1.1), ((2.0, 4.0), 1.4), ((1.0, 1.0), 1.0)])
def test_a_robot_takes_up_a_share_of_each_difference(others: tuple[float, ...], value: float) -> None:
    assert told(*others, gain=0.1) == pytest.approx(value)


def test_first_values_are_drawn_around_the_start() -> None:
    assert told(start_width=0.0) == 1.0
    assert 0.75 <= told(start_width=0.5) <= 1.25
    assert told(start_width=0.5) != 1.0


def test_rows_are_independent() -> None:
    assert_rows_independent(Consensus, Trial(body="point", params={"start_width": 1.0}))


@pytest.mark.parametrize(("graph", "eigenvalue"), [(RING, 2.0 - 2.0 * np.cos(0.2 * np.pi)), (FULL, 10.0)])
def test_without_losses_the_first_pattern_decays_by_the_eigenvalue_and_the_average_stays(graph, eigenvalue) -> None:
    result = run(PAPER, overrides=[graph, "duration_s=2"])
    steps = 19  # told in ticks 0 to 19
    assert result.metrics["first_pattern"].final == pytest.approx((1.0 - 0.05 * eigenvalue) ** steps, rel=1e-6)
    assert result.metrics["consensus_bias"].final == pytest.approx(0.0, abs=1e-12)


def test_a_gain_beyond_two_over_the_largest_eigenvalue_never_agrees() -> None:
    error = {
        gain: run(PAPER, overrides=[FULL, "duration_s=16", f"robots.nodes.params.gain={gain}"])
        .metrics["consensus_error"]
        .final
        for gain in (0.19, 0.21)
    }
    assert (error[0.19] or 0.0) < 1e-6
    assert (error[0.21] or 0.0) > 1.0


def test_two_robots_whose_gain_is_one_over_their_neighbours_only_swap_their_numbers() -> None:
    assert (told(2.0, gain=1.0), told(1.0, gain=1.0, start=2.0)) == (2.0, 1.0)


def test_one_way_losses_move_the_average() -> None:
    result = run(PAPER, overrides=[RING, "radio.loss=0.5"], seeds=range(1, 9))
    final = [arena.metrics["consensus_bias"].final or 0.0 for arena in result.arenas]
    assert 0.01 < np.std(final) < 0.2
