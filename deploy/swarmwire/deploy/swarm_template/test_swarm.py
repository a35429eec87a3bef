"""The swarm moves, hears one another through the loss, and does the same in whatever processes its agents run."""

from functools import cache
from pathlib import Path

from swarmwire.deploy import Result, run

SCENARIO = Path(__file__).with_name("scenario.toml")
SHORT = ["duration_s=3"]


@cache
def short_run() -> Result:
    """A short run with all agents in this process."""
    return run(SCENARIO, overrides=SHORT)


def test_robots_hear_one_another_but_not_every_packet() -> None:
    """The agent sends and hears, over a radio that loses."""
    radio = short_run().radio
    assert radio is not None
    assert radio.fates["received"] > 0
    assert radio.fates["lost"] > 0


def test_robots_move() -> None:
    """The agent drives."""
    order = short_run().metrics["order_velocity"]
    assert order.max is not None
    assert order.max > 0.0  # it is 0 while all stand still


def test_a_process_of_their_own_changes_nothing() -> None:
    """The agent knows what its robot knows, and nothing else: so it is all the same where it runs."""
    assert run(SCENARIO, overrides=SHORT, runners=1).trajectory_sha256 == short_run().trajectory_sha256
