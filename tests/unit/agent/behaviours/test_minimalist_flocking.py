"""The sector rules, case by case on one flockbot."""

import numpy as np
import pytest

from swarmwire.agent.behaviours import MinimalistFlocking
from swarmwire.agent.host import agent_group
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.packets import ReceivedPackets
from swarmwire.comms.tick_io import GroupReadings
from tests.support.agent.hosts import group

RAYS = load_body("flockbot").proximity
assert RAYS is not None
RESPONSE = RAYS.response
DIAMETER_M = 0.07
ANGLES = [-30, 0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300]
STRAIGHT, LEFT, RIGHT = (0.1, 0.0), (0.0, 2.0), (0.0, -2.0)
Seen = dict[int, float]  # angle of a ray in degrees: distance in diameters
NOTHING: Seen = {}


def values(seen: Seen) -> np.ndarray:
    distance_m = np.array([seen.get(angle, np.inf) for angle in ANGLES]) * DIAMETER_M
    return np.where(np.isfinite(distance_m), RESPONSE.value(np.minimum(distance_m, 1.0)), 0.0)


class One:
    """A flockbot; `step` tells it what its rays see, in diameters, and returns speed and turn rate."""

    def __init__(self, **params: float) -> None:
        self._tick = 0
        self._host = agent_group(group("", [0], body="flockbot", params=dict(params)), MinimalistFlocking)

    def step(self, robots: Seen = NOTHING, walls: Seen = NOTHING) -> tuple[float, float]:
        fields = {"infrared.value": values(robots)[None], "proximity.value": values({**walls, **robots})[None]}
        readings = GroupReadings(np.zeros(1, np.int64), fields)
        actions = self._host.act((self._tick, self._tick * 10**7, 10**7), readings, ReceivedPackets.none())
        self._tick += 1
        return float(actions.linear_mps[0]), float(actions.angular_radps[0])


def command(robots: Seen = NOTHING, walls: Seen = NOTHING, **params: float) -> tuple[float, float]:
    return One(**params).step(robots, walls)


def test_rows_do_not_depend_on_one_another():
    assert_rows_independent(MinimalistFlocking, Trial(body="flockbot"))
    assert_rows_independent(MinimalistFlocking, Trial(body="flockbot", seed=2, params={"random_turn": 0.5}))


def test_it_drives_straight_where_nothing_is():
    assert command() == STRAIGHT


@pytest.mark.parametrize(("angle", "turn"), [(30, RIGHT), (-30, LEFT)])
def test_it_avoids_what_is_near_in_front_away_from_the_half_where_it_is_nearest(angle, turn):
    other = -angle
    assert command(walls={angle: 0.9}) == turn
    assert command(walls={angle: 0.8, 0: 0.5, other: 0.9}) == turn
    assert command(walls={angle: 1.1}) == STRAIGHT


@pytest.mark.parametrize("angle", [60, 90, 150, 180, 240, 300])
def test_a_wall_that_is_not_in_front_is_left_alone(angle):
    assert command(walls={angle: 0.1}) == STRAIGHT


def test_a_turn_away_keeps_its_side_until_nothing_is_in_front():
    one = One()
    assert one.step(walls={30: 0.9}) == RIGHT
    assert one.step(walls={-30: 0.2, 30: 0.9}) == RIGHT
    assert one.step() == STRAIGHT
    assert one.step(walls={-30: 0.2, 30: 0.9}) == LEFT


def test_between_equal_halves_a_draw_decides():
    turns = {drawn_turn(tick) for tick in range(20)}
    assert turns == {LEFT, RIGHT}


def drawn_turn(tick: int) -> tuple[float, float]:
    one = One()
    for _ in range(tick):
        one.step()
    return one.step(walls={0: 0.5})


@pytest.mark.parametrize(
    ("angle", "turn"), [(60, RIGHT), (90, RIGHT), (120, RIGHT), (240, LEFT), (270, LEFT), (300, LEFT)]
)
def test_it_turns_away_from_a_robot_beside_it_that_is_too_near(angle, turn):
    assert command({angle: 0.9}) == turn
    assert command({angle: 1.5}) == STRAIGHT  # neither too near nor astray


def test_a_robot_to_the_left_is_turned_from_before_one_to_the_right():
    assert command({90: 0.9, 270: 0.2}) == RIGHT


def test_from_a_robot_in_front_it_turns_to_a_side_that_it_keeps():
    one = One(avoid_diameters=0.1)
    first = one.step({0: 0.5})
    assert first in (LEFT, RIGHT)
    assert all(one.step({angle: 0.5}) == first for angle in (30, -30, 0, 30, -30))


@pytest.mark.parametrize(("angle", "turn"), [(60, LEFT), (120, LEFT), (240, RIGHT), (300, RIGHT)])
def test_it_turns_to_a_robot_beside_it_that_is_astray(angle, turn):
    assert command({angle: 2.1}) == turn
    assert command({angle: 4.9}) == turn
    assert command(walls={angle: 2.1}) == STRAIGHT


def test_it_turns_to_the_side_where_more_rays_see_robots_astray():
    assert command({60: 2.5, 90: 2.5, 270: 2.1}) == LEFT
    assert command({60: 2.5, 240: 2.5, 270: 2.5}) == RIGHT
    assert command({60: 2.5, 270: 2.5, 180: 4.5}) == STRAIGHT


@pytest.mark.parametrize(("angle", "turn"), [(150, LEFT), (210, RIGHT)])
def test_it_turns_to_a_robot_behind_only_if_that_is_farther_than_one_beside_would_have_to_be(angle, turn):
    assert command({angle: 4.1}) == turn
    assert command({angle: 3.9}) == STRAIGHT


def test_a_turn_to_the_rear_keeps_its_side():
    one = One()
    assert one.step({150: 4.1}) == LEFT
    assert one.step({210: 4.1}) == LEFT


def test_the_rules_come_in_their_order():
    everything: Seen = {30: 0.9, 270: 0.9, 60: 2.5, 150: 4.5}
    assert command(everything) == RIGHT  # avoids
    assert command({**everything, 30: 1.5}) == LEFT  # keeps apart
    assert command({60: 2.5, 210: 4.5}) == LEFT  # to the side, before the rear


def test_a_random_turn_comes_before_all_rules_as_often_as_asked():
    one = One(random_turn=0.3)
    steps = [one.step() for _ in range(1000)]
    turned = np.mean([step != STRAIGHT for step in steps])
    assert turned == pytest.approx(0.3, abs=0.06)  # four standard deviations
    assert {LEFT, RIGHT} <= set(steps)
    assert all(One(random_turn=1.0).step(walls={30: 0.1}) in (LEFT, RIGHT) for _ in range(3))
