"""The force and the wheels of ARGoS's flocking example, and what they make of ten foot-bots."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import LennardJonesFlocking
from swarmwire.agent.behaviours.lennard_jones_flocking import Here
from swarmwire.agent.host import agent_group
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.comms.packets import Payloads, ReceivedPackets
from swarmwire.comms.tick_io import GroupReadings
from swarmwire.deploy import run
from tests.support.agent.hosts import group

BASE_M, MAX_MPS = 0.14, 0.1
SCENARIO = Path("scenarios/behaviours/lennard_jones_flocking.toml")


class One:
    """A foot-bot; `step` gives it neighbours (range in m, bearing in degrees), and returns its left and right wheel."""

    def __init__(self, **params: float) -> None:
        self._tick = 0
        self._host = agent_group(group("", [0], body="footbot", params=dict(params)), LennardJonesFlocking)

    def step(self, *neighbours: tuple[float, float], light_ray: int | None = None) -> tuple[float, float]:
        k = len(neighbours)
        table = np.array(neighbours, np.float64).reshape(-1, 2)
        zeros = np.zeros(k, np.int64)
        given = {"range_m": table[:, 0], "bearing_rad": np.deg2rad(table[:, 1])}
        received = ReceivedPackets(
            zeros, np.arange(1, k + 1), zeros, zeros, given, np.arange(k), Payloads.of([Here().encode()] * k)
        )
        light = np.zeros((1, 24))
        if light_ray is not None:
            light[0, light_ray] = 0.4
        fields = {"light.value": light}
        actions = self._host.act(
            (self._tick, self._tick * 10**8, 10**8), GroupReadings(np.zeros(1, np.int64), fields), received
        )
        self._tick += 1
        forward, turn = float(actions.linear_mps[0]), float(actions.angular_radps[0])
        return forward - 0.5 * BASE_M * turn, forward + 0.5 * BASE_M * turn


def wheels(*neighbours: tuple[float, float], **params: float) -> tuple[float, float]:
    return One(**params).step(*neighbours)


def test_rows_do_not_depend_on_one_another():
    assert_rows_independent(LennardJonesFlocking, Trial(body="footbot"))


@pytest.mark.parametrize("distance_cm", [40.0, 60.0, 74.0, 76.0, 90.0, 130.0])
def test_the_force_is_that_of_the_source_in_other_units(distance_cm):
    ratio = (75.0 / distance_cm) ** 2
    in_cm = -1000.0 / distance_cm * (ratio * ratio - ratio)
    force = LennardJonesFlocking().force(np.array([distance_cm / 100.0]))
    assert force == pytest.approx([in_cm / 100.0])
    assert np.sign(force[0]) == np.sign(distance_cm - 75.0)


def test_a_neighbour_at_the_target_distance_neither_pulls_nor_pushes():
    assert wheels((0.75, 30.0)) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_a_far_neighbour_ahead_pulls_and_one_out_of_reach_does_not():
    left, right = wheels((1.0, 0.0))
    assert left == right == pytest.approx(LennardJonesFlocking().force(np.array([1.0]))[0])
    assert wheels((1.36, 0.0)) == (0.0, 0.0)


def test_a_near_neighbour_ahead_turns_the_robot_on_the_spot_and_one_behind_drives_it_on():
    left, right = wheels((0.5, 0.0))
    assert left == -right
    assert abs(left) == pytest.approx(MAX_MPS)
    assert wheels((0.5, 180.0)) == pytest.approx((MAX_MPS, MAX_MPS))


def test_neighbours_count_by_their_mean_and_those_out_of_reach_do_not_thin_it():
    one = wheels((1.0, 0.0))
    assert wheels((1.0, 0.0), (0.75, 90.0)) == pytest.approx(tuple(0.5 * speed for speed in one))
    assert wheels((1.0, 0.0), (2.0, 90.0)) == pytest.approx(one)


def test_beyond_10_degrees_it_turns_softly_and_within_it_does_not():
    pull = LennardJonesFlocking().force(np.array([1.0]))[0]
    assert wheels((1.0, 9.0)) == pytest.approx((pull, pull))
    assert wheels((1.0, 45.0)) == pytest.approx((0.5 * pull, 1.5 * pull), rel=1e-4)
    assert wheels((1.0, -45.0)) == pytest.approx((1.5 * pull, 0.5 * pull), rel=1e-4)


def test_a_hard_turn_begins_beyond_90_degrees_and_lasts_until_70():
    one, on_the_spot = One(), pytest.approx((-MAX_MPS, MAX_MPS))
    assert one.step((1.0, 85.0)) != on_the_spot
    assert one.step((1.0, 95.0)) == on_the_spot
    assert one.step((1.0, 85.0)) == on_the_spot
    assert one.step((1.0, 69.0)) != on_the_spot
    assert one.step((1.0, 85.0)) != on_the_spot


def test_the_light_pulls_by_a_quarter_of_the_top_speed_unless_it_is_no_goal():
    ahead = 0  # at 7.5 degrees
    assert One().step(light_ray=ahead) == pytest.approx((0.25 * MAX_MPS,) * 2)
    assert One(light=0.0).step(light_ray=ahead) == (0.0, 0.0)


def test_a_range_that_noise_made_negative_is_a_neighbour_that_is_very_near():
    assert wheels((-0.01, 180.0)) == pytest.approx((MAX_MPS, MAX_MPS))


def spread_m(*overrides: str) -> float:
    """The distance from a foot-bot to its nearest neighbour after 15 s, mean over robots."""
    given = ["metrics=['nearest_neighbour']", "duration_s=15", "robots.flock.place.radius_m=0.8", *overrides]
    final = run(SCENARIO, seeds=[1], overrides=given).metrics["nearest_neighbour"].final
    assert final is not None
    return final


def test_ten_spread_to_about_the_target_distance_and_not_without_the_radio():
    assert 0.5 < spread_m("robots.flock.params={light=0.0}") < 0.85
    assert spread_m("robots.flock.params={light=0.0}", "radio.loss=1.0") < 0.4
