"""The article's threshold rule and its smoothed cure, each by a scanner and by rays around the body."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import (
    SmoothedAvoidance,
    SmoothedAvoidanceProximity,
    ThresholdRule,
    ThresholdRuleProximity,
)
from swarmwire.agent.host import agent_group
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.packets import ReceivedPackets
from swarmwire.comms.tick_io import GroupReadings
from swarmwire.deploy import run
from tests.support.agent.hosts import group

FOOTBOT, BURGER = load_body("footbot"), load_body("turtlebot3-burger")
CORRIDOR = Path(__file__).parents[4] / "scenarios" / "papers" / "scenarios" / "corridor.toml"
SHOWN = Path(__file__).parents[4] / "scenarios" / "behaviours"
ON, BACK = (0.2, 0.0), (-0.1, 0.5)  # the article's numbers


class One:
    """One robot whose tests say what its rays see."""

    def __init__(self, kind: type[VectorAgent], **params: float) -> None:
        self.body = "turtlebot3-burger" if "scan" in kind.needs else "footbot"
        self._tick, self._host = 0, agent_group(group("", [0], body=self.body, params=dict(params)), kind)

    def step(self, **readings: FloatArray) -> tuple[float, float]:
        fields = {name.replace("_", ".", 1): reading[None, :] for name, reading in readings.items()}
        at = GroupReadings(np.zeros(1, np.int64), fields)
        actions = self._host.act((self._tick, self._tick * 10**8, 10**8), at, ReceivedPackets.none(()))
        self._tick += 1
        return float(actions.linear_mps[0]), float(actions.angular_radps[0])

    def sees(self, *things: tuple[float, float], wide_deg: float = 0.5) -> tuple[float, float]:
        """Its command where the scanner sees things, each at (angle_deg, range_m), so wide to either side."""
        range_m = np.full(360, np.inf)
        for angle_deg, far_m in things:
            assert BURGER.scan is not None
            off = np.rad2deg(np.angle(np.exp(1j * (BURGER.scan.angle_rad - np.deg2rad(angle_deg)))))
            range_m[np.abs(off) <= wide_deg] = far_m
        return self.step(scan_range_m=range_m)


@pytest.mark.parametrize("angle_deg", [0.0, 90.0, 180.0, -90.0])
def test_nearer_than_half_a_metre_on_any_side_is_backed_off_from_always_to_the_left(angle_deg: float) -> None:
    one = One(ThresholdRule)
    assert one.sees() == ON
    assert one.sees((angle_deg, 0.49)) == BACK
    assert one.sees((angle_deg, 0.51)) == ON, "nothing is remembered"


def test_the_threshold_and_its_speeds_are_parameters() -> None:
    one = One(ThresholdRule, safe_m=0.3, speed_mps=0.15, back_mps=0.05, turn_radps=-1.0)
    assert (one.sees((0.0, 0.31)), one.sees((0.0, 0.29))) == ((0.15, 0.0), (-0.05, -1.0))


def rays(*seen: tuple[int, float]) -> FloatArray:
    """Answers of a foot-bot's rays that see something at a distance from the rim."""
    value = np.zeros(24)
    assert FOOTBOT.proximity is not None
    for ray, far_m in seen:
        value[ray] = FOOTBOT.proximity.response.value(np.array(far_m))
    return value


@pytest.mark.parametrize("ray", [0, 7, 12, 23])
def test_by_rays_the_threshold_is_from_the_rim(ray: int) -> None:
    one = One(ThresholdRuleProximity, safe_m=0.05)
    assert one.step(proximity_value=rays()) == (0.1, 0.0), "rays that see nothing are not at their reach"
    assert one.step(proximity_value=rays((ray, 0.045))) == (-0.05, 0.5)
    assert one.step(proximity_value=rays((ray, 0.055))) == (0.1, 0.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_cure_turns_away_and_never_drives_backwards(side: float) -> None:
    scanner, short = One(SmoothedAvoidance), One(SmoothedAvoidanceProximity)
    ray = 1 if side > 0.0 else 22  # at 22.5 degrees
    for _ in range(20):
        by_scanner = scanner.sees((side * 30.0, 0.3), wide_deg=20.0)
        by_rays = short.step(proximity_value=rays((ray, 0.02)))
        for linear, angular in (by_scanner, by_rays):
            assert linear >= 0.0
            assert np.sign(angular) == -side


def test_the_cure_goes_straight_on_between_walls_that_are_equally_near() -> None:
    one = One(SmoothedAvoidance)
    commands = [one.sees((90.0, 0.3), (-90.0, 0.3), wide_deg=40.0) for _ in range(30)]
    assert commands[-1] == pytest.approx(ON, abs=1e-3)


def test_the_cure_comes_up_to_its_speed_with_its_time_constant() -> None:
    one = One(SmoothedAvoidance, smooth_s=0.3)
    linear = [one.sees()[0] for _ in range(3)]
    assert linear == pytest.approx([0.2 * (1.0 - 0.75**step) for step in (1, 2, 3)])
    assert One(SmoothedAvoidance, smooth_s=0.0).sees() == ON


def test_blocked_the_cure_keeps_its_side_until_the_way_is_free() -> None:
    """What is ahead seems now a little to the left, now a little to the right."""
    steady, fickle = One(SmoothedAvoidance, smooth_s=0.0), One(SmoothedAvoidance, smooth_s=0.0, blocked_rad=4.0)
    where = [3.0, -3.0, 3.0, -3.0]
    assert {np.sign(steady.sees((angle, 0.25), wide_deg=40.0)[1]) for angle in where} == {-1.0}
    assert {np.sign(fickle.sees((angle, 0.25), wide_deg=40.0)[1]) for angle in where} == {-1.0, 1.0}
    assert steady.sees() == ON, "nothing is in its way any more"
    assert steady.sees((-3.0, 0.25), wide_deg=40.0)[1] > 0.0, "and the side is chosen anew"


@pytest.mark.parametrize("kind", [ThresholdRule, SmoothedAvoidance])
def test_by_a_scanner_each_robot_decides_alone(kind: type[VectorAgent]) -> None:
    assert_rows_independent(kind, Trial(body="turtlebot3-burger"))


@pytest.mark.parametrize("kind", [ThresholdRuleProximity, SmoothedAvoidanceProximity])
def test_by_rays_each_robot_decides_alone(kind: type[VectorAgent]) -> None:
    assert_rows_independent(kind, Trial(body="footbot"))
    assert_rows_independent(kind, Trial(body="epuck", seed=2))


def test_in_a_corridor_the_rule_deadlocks_and_its_cure_does_not() -> None:
    rule, cure = (
        run(CORRIDOR, seeds=[1], overrides=["duration_s=40", f"robots.crowd.agent='swarmwire.agent.behaviours:{kind}'"])
        for kind in ("ThresholdRule", "SmoothedAvoidance")
    )
    assert (rule.metrics["deadlocked"].final or 0.0) >= 0.5
    assert cure.metrics["deadlocked"].final == 0.0


def test_by_rays_the_cure_meets_nobody_where_the_rule_does() -> None:
    contacts = {
        name: run(SHOWN / f"{name}_proximity.toml", overrides=["duration_s=20"]).metrics["collisions"].final
        for name in ("threshold_rule", "smoothed_avoidance")
    }
    assert contacts["smoothed_avoidance"] == 0.0
    assert contacts["threshold_rule"] is not None
    assert contacts["threshold_rule"] > 0.0
