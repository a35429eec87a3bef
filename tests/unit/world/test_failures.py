"""What a part that failed does to a robot: motors brake, a wheel drags, a sense reads as if all were lost."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import run
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.world.samples import changed, commanded, posed

POSES = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]


def moved(failed: dict[str, np.ndarray], ticks: int = 20) -> World:
    world = World(posed(POSES), [1], {"a": ("proximity", "compass")})
    world.fail(failed)
    for _ in range(ticks):
        world.move(commanded(world, 0.1, 0.0))
    return world


def test_failed_motors_brake_and_the_others_go_on():
    world = moved({"motors": np.array([True, False])})
    assert np.abs(world.pose[0] - POSES[0]).max() < 1e-9
    assert world.pose[1, 0] > POSES[1][0] + 0.15


@pytest.mark.parametrize(("part", "sign"), [("left_wheel", 1.0), ("right_wheel", -1.0)])
def test_a_robot_turns_around_the_wheel_that_failed(part: str, sign: float):
    world = moved({part: np.array([True, False])})
    base_m = world.static.groups[0].body.wheels.wheel_base_m
    assert world.velocity[0, 2] == pytest.approx(sign * 0.1 / base_m, rel=1e-3)
    # The wheel that stands still is the centre of the circle.
    assert np.hypot(*(world.pose[0, :2] - [-1.0, sign * base_m / 2])) == pytest.approx(base_m / 2, rel=0.05)


def test_a_sense_that_failed_reads_blank_until_it_is_mended():
    world = moved({"compass": np.array([True, False])}, ticks=1)
    heading = world.sense(1)["a"].fields["compass.heading_rad"]
    assert np.isnan(heading[0])
    assert np.isfinite(heading[1])
    world.fail({})
    assert np.isfinite(world.sense(2)["a"].fields["compass.heading_rad"]).all()


def event(**keys: Any) -> dict[str, Any]:
    return {"at_s": 1.0, "do": "fail", "robots": {"group": "flock"}, **keys}


@pytest.mark.parametrize(
    ("table", "told"),
    [
        (event(), "events.0.part: is missing"),
        (event(part="nose"), "events.0.part: expected one of battery, motors, left_wheel, right_wheel, proximity, "),
        (event(part="motors", per_hour=0.0), "events.0.per_hour: expected a number above 0"),
    ],
)
def test_what_cannot_fail_is_refused(table: dict[str, Any], told: str):
    with pytest.raises(BadInput, match=rf"sample\.toml: {told}"):
        scenario_from(changed("events", [table]), "sample.toml")


def test_failures_are_told_and_equal_for_an_arena_alone_and_beside_others():
    table = event(part="motors", per_hour=2000.0, for_s=1.0)
    del table["robots"]["group"]
    table["robots"]["share"] = 0.5
    mapping = {**changed("events", [table]), "duration_s": 4.0}
    for group in mapping["robots"].values():
        group["agent"] = "swarmwire.agent.behaviours:Diffusion"
    scenario = scenario_from(mapping, "sample.toml")
    alone = [run(scenario, seed=seed).trajectory_sha256[0] for seed in (3, 4)]
    assert run(scenario, seeds=[3, 4]).trajectory_sha256 == alone
    without = scenario_from({**mapping, "events": []}, "sample.toml")
    assert run(without, seed=3).trajectory_sha256[0] != alone[0], "something must have failed"
