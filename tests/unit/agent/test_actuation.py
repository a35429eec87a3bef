"""What agents ask of motors and LEDs, through both kinds of handle."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.agent import Agent, Robot, Robots, State, VectorAgent
from swarmwire.agent.host import agent_group
from swarmwire.agent.testing import Trial, assert_equivalent, assert_rows_independent
from swarmwire.comms.bodies.body import body_from
from swarmwire.comms.errors import AgentFailed
from swarmwire.comms.packets import ReceivedPackets
from swarmwire.comms.tick_io import Actions
from tests.support.agent.hosts import MEASURES, group, readings

ROWS = [1, 4, 6]
EPUCK_BASE_M = 0.053
FLOATING = {"kind": "holonomic", "max_speed_mps": 1, "max_angular_radps": 1, "max_force_n": 1, "max_torque_nm": 1}


def acted(kind: type[Any], **spec: Any) -> Actions:
    """What three robots of this body do in their first step."""
    body = body_from({"like": "epuck", "name": "mine", **spec}, "mine.toml")
    host = agent_group(replace(group("", ROWS), body=body), kind)
    return host.act((0, 0, 100_000_000), readings(0, ROWS), ReceivedPackets.none(MEASURES))


def single(does: Callable[[Robot], None]) -> type[Agent]:
    return type("Mine", (Agent,), {"step": lambda _, robot: does(robot)})


def vector(does: Callable[[Robots], None]) -> type[Any]:
    class Mine(VectorAgent):
        def step(self, robots: Robots, state: State) -> None:
            does(robots)

    return Mine


def colours(actions: Actions) -> dict[tuple[int, int], str]:
    table = actions.leds
    named = zip(table.rows.tolist(), table.place.tolist(), table.integers.tolist(), strict=True)
    return {(row, which): f"{rgb:06x}" for row, which, rgb in named}


def test_a_speed_sideways_is_asked_for_with_the_others() -> None:
    for mine in (
        single(lambda robot: robot.drive(0.1, 0.2, -0.3)),
        vector(lambda robots: robots.drive(0.1, 0.2, -0.3)),
    ):
        actions = acted(mine, drive=FLOATING)
        assert actions.drive.all()
        assert actions.lateral_mps.tolist() == [-0.3] * 3
    rows = np.array([True, False, True])
    some = acted(vector(lambda robots: robots.drive(0.1, 0.2, np.arange(3.0), rows=rows)), drive=FLOATING)
    assert (some.drive.tolist(), some.lateral_mps.tolist()) == (rows.tolist(), [0.0, 0.0, 2.0])


def test_a_later_drive_without_a_speed_sideways_has_none() -> None:
    def twice(robot: Robot) -> None:
        robot.drive(0.1, 0.2, 0.3)
        robot.drive(0.1, 0.2)

    assert not acted(single(twice), drive=FLOATING).lateral_mps.any()


def test_wheel_speeds_become_forward_and_turn() -> None:
    one = acted(single(lambda robot: robot.wheels(0.02, 0.05)))
    assert one.drive.all()
    np.testing.assert_allclose(one.linear_mps, 0.035)
    np.testing.assert_allclose(one.angular_radps, 0.03 / EPUCK_BASE_M)
    rows = np.array([True, False, True])
    some = acted(vector(lambda robots: robots.wheels([0.02, 0.0, 0.05], 0.05, rows=rows)))
    assert some.drive.tolist() == rows.tolist()
    np.testing.assert_allclose(some.linear_mps[rows], [0.035, 0.05])
    np.testing.assert_allclose(some.angular_radps[rows], [0.03 / EPUCK_BASE_M, 0.0])
    assert not some.linear_mps[1]


@pytest.mark.parametrize(
    ("kind", "fault"),
    [
        (single(lambda robot: robot.wheels(0.1, 0.1)), "the body mine has no wheels: its drive is holonomic"),
        (vector(lambda robots: robots.wheels(0.1, 0.1)), "the body mine has no wheels: its drive is holonomic"),
        (single(lambda robot: robot.led(1.0, 0.0, 0.0, which=8)), "the body mine has LEDs 0 to 7, got 8"),
        (vector(lambda robots: robots.led(1.0, 0.0, 0.0, which=-1)), "the body mine has LEDs 0 to 7, got -1"),
        (single(lambda robot: robot.led(255, 0, 0)), "expected numbers from 0 to 1, got 255"),
        (single(lambda robot: robot.led(0.0, -0.1, 0.0)), "expected numbers from 0 to 1, got -0.1"),
        (vector(lambda robots: robots.led(0.0, 0.0, [0.1, np.nan, 0.2])), "expected numbers from 0 to 1"),
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)
def test_what_a_body_cannot_do_is_said_clearly(kind: type[Any], fault: str) -> None:
    with pytest.raises(AgentFailed) as caught:
        acted(kind, drive=FLOATING)
    assert fault in caught.value.traceback


def test_a_body_without_leds_says_so() -> None:
    bare = replace(group("", ROWS), body=replace(group("", ROWS).body, leds=None))
    with pytest.raises(AgentFailed, match="IncompatibleBody: the body epuck has no LEDs"):
        agent_group(bare, single(lambda robot: robot.led(1.0, 0.0, 0.0))).act(
            (0, 0, 100_000_000), readings(0, ROWS), ReceivedPackets.none(MEASURES)
        )


def test_all_leds_or_one_get_a_colour_and_the_last_one_counts() -> None:
    def paint(robot: Robot) -> None:
        robot.led(0.0, 1.0, 0.5)
        robot.led(1.0, 0.0, 0.0, which=3)

    for mine in (single(paint), vector(paint)):
        shown = colours(acted(mine))
        assert set(shown) == {(row, led) for row in ROWS for led in range(8)}
        assert {led: shown[4, led] for led in range(8)} == {**dict.fromkeys(range(8), "00ff80"), 3: "ff0000"}


def test_robots_have_colours_of_their_own_within_a_mask() -> None:
    def paint(robots: Robots) -> None:
        robots.led(np.array([0.0, 0.5, 1.0]), 0.0, 1.0, which=2, rows=np.array([False, True, True]))

    assert colours(acted(vector(paint))) == {(4, 2): "8000ff", (6, 2): "ff00ff"}


def test_dark_is_a_colour_and_who_says_nothing_changes_nothing() -> None:
    def one_only(robots: Robots) -> None:
        robots.led(0.0, 0.0, 0.0, which=7, rows=np.array([True, False, False]))

    assert colours(acted(vector(one_only))) == {(1, 7): "000000"}
    assert len(acted(vector(lambda robots: robots.drive(0.1, 0.0))).leds) == 0


class Blinks(Agent):
    """A colour that tells its compass, on an LED that tells the tick."""

    needs = ("compass",)

    def step(self, robot: Robot) -> None:
        robot.led(0.0, 0.5 + robot.compass.heading_rad / 8.0, 0.0, which=round(10.0 * robot.time_s) % 8)


class BlinksToo(VectorAgent):
    needs = ("compass",)

    def step(self, robots: Robots, state: State) -> None:
        robots.led(0.0, 0.5 + robots.compass.heading_rad / 8.0, 0.0, which=round(10.0 * robots.time_s) % 8)


class BlinksAlike(BlinksToo):
    def step(self, robots: Robots, state: State) -> None:
        heading = np.full(robots.n, robots.compass.heading_rad.mean())
        robots.led(0.0, 0.5 + heading / 8.0, 0.0, which=round(10.0 * robots.time_s) % 8)


def test_equivalence_and_independence_hold_for_leds_too() -> None:
    assert_equivalent(Blinks, BlinksToo)
    assert_rows_independent(BlinksToo, Trial(body="footbot"))
    with pytest.raises(AssertionError, match=r"in tick 0, robot 0:\n  led 0: 0x"):
        assert_equivalent(Blinks, BlinksAlike)
    with pytest.raises(AssertionError, match=r"in tick 0, robot 0:\n  led 0: 0x"):
        assert_rows_independent(BlinksAlike)
