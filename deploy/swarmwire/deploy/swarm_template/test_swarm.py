"""The swarm moves, hears one another through the loss, and does the same in whatever processes its agents run."""

from pathlib import Path

from swarmwire.deploy import run

SCENARIO = Path(__file__).with_name("scenario.toml")
SHORT = ["duration_s=3"]


def test_robots_hear_one_another_but_not_every_packet() -> None:
    """The agent sends and hears, over a radio that loses."""
    radio = run(SCENARIO, overrides=SHORT).radio
    assert radio is not None
    assert radio.fates["heard"] > 0
    assert radio.fates["lost"] > 0


def test_robots_move() -> None:
    """The agent drives."""
    order = run(SCENARIO, overrides=SHORT).metrics["order_velocity"]
    assert order.max is not None
    assert order.max > 0.0  # it is 0 while all stand still


def test_a_process_of_their_own_changes_nothing() -> None:
    """The agent knows what its robot knows, and nothing else: so it is all the same where it runs."""
    here = run(SCENARIO, overrides=SHORT)
    there = run(SCENARIO, overrides=SHORT, runners=1)
    assert there.trajectory_sha256 == here.trajectory_sha256
