"""One rule in three ways: a plain class, a finite state machine, a behaviour tree."""

import pytest

from swarmwire.deploy import Result, run
from tests.integration.examples.test_examples import EXAMPLES

LAMP = EXAMPLES / "ways" / "lamp.toml"


def run_of(way: str, duration_s: float) -> Result:
    return run(LAMP, overrides=[f"robots.seekers.agent='{way}.py:Seeker'", f"duration_s={duration_s}"])


@pytest.fixture(scope="module")
def plain() -> Result:
    return run_of("plain", 60.0)


def test_most_seekers_come_to_the_lamp(plain: Result):
    distance_m = plain.metrics["target_mean"]
    assert distance_m.final is not None
    assert distance_m.max is not None
    assert distance_m.final < 0.5 * distance_m.max


@pytest.mark.parametrize("way", ["state_machine", "behaviour_tree"])
def test_every_way_moves_the_swarm_alike(way: str, plain: Result):
    assert run_of(way, 60.0).trajectory_sha256 == plain.trajectory_sha256
