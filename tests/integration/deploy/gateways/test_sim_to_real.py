"""The same agents, emulated and through protocols of real robots, come to the same within the spread of seeds."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.deploy import Result, run
from tests.support.deploy.gateways import Speeds, driven, measured, outside
from tests.support.deploy.runs import ROOT

SEEDS = range(1, 21)
SEED = 2  # of runs through gateways
PACES = (4.0, 2.0, 1.0)  # times real time
MAX_MISSED = 0.1  # of the ticks: a machine that did not keep up tells nothing of the robots
GATEWAYS = {"epuck2": "epuck2", "turtlebot": "ros2", "turtlebot4": "ros2"}  # by the body in the scenarios' names
TOUCHES = ("collisions", "wall_contacts")


@dataclass(frozen=True)
class Case:
    """A behaviour, in how it is tried and judged."""

    group: str
    duration_s: float
    judged: tuple[str, ...]  # by these numbers

    @property
    def overrides(self) -> tuple[str, ...]:
        return f"duration_s={self.duration_s}", f"robots.{self.group}.count={ROBOTS}"


CASES = {
    "avoidance": Case("wanderers", 20.0, ("speed", "min_gap", *TOUCHES)),
    "flocking": Case("flock", 20.0, ("speed", "order", "min_gap", *TOUCHES)),
    "pso": Case("particles", 30.0, ("speed", "target_best", "target_mean", *TOUCHES)),
}
ALL = [(behaviour, body) for behaviour in CASES for body in ("epuck2", "turtlebot")] + [("avoidance", "turtlebot4")]
ALWAYS = {("flocking", "epuck2"), ("avoidance", "turtlebot"), ("pso", "epuck2")}  # not only in slow tests
ROBOTS = 5


def scenario(behaviour: str, body: str) -> Path:
    return ROOT / "scenarios" / "robots" / f"{behaviour}-{body}.toml"


@cache
def spread(behaviour: str, body: str) -> dict[str, FloatArray]:
    """What runs with all agents in this process come to, by name, a number for each seed."""
    speeds, overrides = Speeds(), CASES[behaviour].overrides
    arenas = run(scenario(behaviour, body), seeds=SEEDS, overrides=overrides, observers=[speeds]).arenas
    results = [measured(arena, speeds.means(index)) for index, arena in enumerate(arenas)]
    return {name: np.array([measures[name] for measures in results]) for name in results[0]}


def through_gateway(
    behaviour: str, body: str, folder: Path, *, broken: bool = False, radio: str | None = None
) -> tuple[dict[str, float], Result]:
    """What a run with its robots behind gateways comes to; tried once more at a lower pace if the machine lagged."""
    overrides = (*CASES[behaviour].overrides, f"seed={SEED}")
    more = {"overrides": overrides, "radio": radio, "broken": broken}
    for pace in PACES:
        speeds = Speeds()
        out = folder / f"at-{pace:g}"
        result = driven(scenario(behaviour, body), GATEWAYS[body], out, pace=pace, observers=[speeds], **more)
        if result.realtime.missed_ticks <= MAX_MISSED * result.ticks:
            return measured(result.arenas[0], speeds.means(0)), result
    pytest.skip(f"over {MAX_MISSED:.0%} of the ticks missed at every pace: that tells of this machine, not of robots")


@pytest.mark.parametrize(
    ("behaviour", "body"), [pytest.param(*case, marks=() if case in ALWAYS else pytest.mark.slow) for case in ALL]
)
def test_agents_through_a_gateway_come_to_what_emulated_ones_do(behaviour, body, tmp_path) -> None:
    expected = spread(behaviour, body)
    measures, result = through_gateway(behaviour, body, tmp_path)
    assert not outside(measures, expected, CASES[behaviour].judged), (measures, result.realtime, result.counts)


@pytest.mark.parametrize(
    ("behaviour", "body"),
    [pytest.param(*case, marks=() if case == ("flocking", "epuck2") else pytest.mark.slow) for case in ALL],
)
def test_driver_that_turns_the_wrong_way_is_outside_the_spread(behaviour, body, tmp_path) -> None:
    expected = spread(behaviour, body)
    measures, _ = through_gateway(behaviour, body, tmp_path, broken=True)
    assert outside(measures, expected, CASES[behaviour].judged), measures


def test_flock_over_the_robots_own_network_matches_an_emulated_one(tmp_path) -> None:
    """Range and bearing are from poses that the run tells as a tracker would."""
    expected = spread("flocking", "epuck2")
    measures, result = through_gateway("flocking", "epuck2", tmp_path, radio="zenoh")
    assert not outside(measures, expected, CASES["flocking"].judged), (measures, result.realtime, result.counts)
    assert result.radio.sent == 0, "the medium of the run carried nothing"
