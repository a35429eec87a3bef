"""Every scenario for a few robots on a desk tells its story, emulated as any other."""

import pytest

from swarmwire.deploy import Result, run
from swarmwire.world.scenario_file import load_scenario
from tests.support.deploy.commands import ROOT

FOLDER = ROOT / "scenarios" / "robots"
NOT_SCENARIOS = {"turtlebot"}
BODIES = ("epuck2", "turtlebot")


def shipped(behaviour: str, body: str) -> Result:
    return run(FOLDER / f"{behaviour}-{body}.toml")


def final(result: Result, metric: str) -> float:
    value = result.metrics[metric].final
    assert value is not None, metric
    return value


def test_all_of_them_are_tried_here_and_are_small_enough_for_a_desk() -> None:
    names = {path.stem for path in FOLDER.glob("*.toml")} - NOT_SCENARIOS
    assert names == {f"{behaviour}-{body}" for behaviour in ("avoidance", "flocking", "pso") for body in BODIES}
    for name in names:
        scenario = load_scenario(FOLDER / f"{name}.toml")
        assert 6 <= sum(table.count for table in scenario.robots.values()) <= 10
        assert scenario.arena.size_m == (3.0, 3.0)


@pytest.mark.parametrize("body", BODIES)
def test_wanderers_touch_nothing(body) -> None:
    result = shipped("avoidance", body)
    assert (final(result, "collisions"), final(result, "wall_contacts")) == (0, 0)
    assert (result.metrics["order"].mean or 0.0) < 0.6


@pytest.mark.parametrize("body", BODIES)
def test_a_flock_finds_one_heading(body) -> None:
    result = shipped("flocking", body)
    assert (result.metrics["order"].min or 0.0) < 0.8
    assert final(result, "order") > 0.9
    assert final(result, "largest_component") == 1.0
    assert result.radio is not None
    assert result.radio.link_pdr == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("body", BODIES)
def test_particles_gather_at_the_lamp(body) -> None:
    result = shipped("pso", body)
    assert final(result, "target_best") < 0.3
    assert final(result, "target_mean") < 0.6
