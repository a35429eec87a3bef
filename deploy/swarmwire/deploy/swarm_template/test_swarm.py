"""The swarm moves, hears one another through the loss, and does the same in whatever processes its agents run."""

from pathlib import Path

import pytest

from swarmwire.deploy import Result, run

SCENARIO = Path(__file__).with_name("scenario.toml")
SHORT = ["duration_s=3"]


@pytest.fixture(scope="module")
def result() -> Result:
    """A short run with all agents in this process."""
    return run(SCENARIO, overrides=SHORT)


def test_robots_hear_one_another_but_not_every_packet(result: Result) -> None:
    """The agent sends and hears, over a radio that loses."""
    assert result.radio is not None
    assert result.radio.fates["heard"] > 0
    assert result.radio.fates["lost"] > 0


def test_robots_move(result: Result) -> None:
    """The agent drives."""
    order = result.metrics["order_velocity"]
    assert order.max is not None
    assert order.max > 0.0  # it is 0 while all stand still


def test_a_process_of_their_own_changes_nothing(result: Result) -> None:
    """The agent knows what its robot knows, and nothing else: so it is all the same where it runs."""
    assert run(SCENARIO, overrides=SHORT, runners=1).trajectory_sha256 == result.trajectory_sha256
