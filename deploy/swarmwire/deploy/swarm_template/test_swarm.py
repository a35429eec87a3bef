"""The swarm moves and aligns, receives packets despite the loss, and runs alike in one process and in several."""

from functools import cache
from pathlib import Path

from swarmwire.deploy import Result, run
from swarmwire.deploy.testing import Expect

SCENARIO = Path(__file__).with_name("scenario.toml")
SHORT = ["duration_s=3"]


@cache
def short_run() -> Result:
    """A short run with all agents in this process."""
    return run(SCENARIO, overrides=SHORT)


def test_some_packets_are_received_and_some_are_lost() -> None:
    """The agent sends and receives over a lossy radio."""
    radio = short_run().radio
    assert radio is not None
    assert radio.fates["received"] > 0
    assert radio.fates["lost"] > 0


def test_robots_move() -> None:
    """The agent drives."""
    order = short_run().metrics["order_velocity"]
    assert order.max is not None
    assert order.max > 0.0  # 0 would mean that all robots stand still


def test_robots_align_despite_the_loss(expect: Expect) -> None:
    """The rule works: the 95 % interval of the median over ten seeds lies above the bound."""
    expect(run(SCENARIO, seeds=10, overrides=["duration_s=10"]), "order.final >= 0.8", "radio.link_pdr > 0.7")


def test_a_run_in_another_process_is_the_same() -> None:
    """The agent uses the inputs of its own robot alone, so its process does not matter."""
    assert run(SCENARIO, overrides=SHORT, runners=1).trajectory_sha256 == short_run().trajectory_sha256
