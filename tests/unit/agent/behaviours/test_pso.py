"""Particle swarms: the rule, neighbourhoods, noise, and the point-particle model."""

from typing import Any

import numpy as np
import pytest

from swarmwire.agent.behaviours import PsoModel, PsoSearch, PsoSearchPositioned
from swarmwire.agent.behaviours.pso.core import ParticleSwarm
from swarmwire.agent.behaviours.pso.variants import BestVector
from swarmwire.agent.parameters import BadParameter, checked_parameters
from tests.support.agent.behaviours import START, SingleParticle, best_at

FURTHEST_M = 0.1 * 10.0  # speed x time between two updates
CALM = {"inertia": 0.0, "own_weight": 0.0, "neighbour_weight": 0.0}  # the robot stays where it is
AGAIN_M = 0.1
SPEED_MPS, PERIOD_S = 0.1, 0.1


@pytest.mark.parametrize("pull", [0.0, 1.5, 100.0])
def test_target_is_within_reach_until_the_next_update(pull: float) -> None:
    robot = SingleParticle(inertia=3.0, neighbour_weight=pull)
    robot.step(best_at(9.0, 4.0, 4.0))
    for _ in range(4):
        assert 0.0 < np.hypot(*robot.vector("velocity")) <= FURTHEST_M + 1e-9
        assert robot.vector("target") == robot.vector("velocity")
        robot.steps(100)


def test_velocity_changes_once_per_update_period() -> None:
    robot, velocities = SingleParticle(), list[tuple[float, float]]()
    for _ in range(201):
        robot.step()
        velocities.append(robot.vector("velocity"))
    assert [tick for tick in range(1, 201) if velocities[tick] != velocities[tick - 1]] == [100, 200]


def test_velocity_is_inertia_plus_attractions_within_their_weights() -> None:
    still = SingleParticle(own_weight=0.0, neighbour_weight=0.0)
    still.step()
    first = np.array(still.vector("velocity"))
    still.steps(100)
    assert np.array(still.vector("velocity")) == pytest.approx(0.7298 * first)

    pulled = SingleParticle(inertia=0.0, own_weight=0.0, neighbour_weight=1.0)
    pulled.step()
    pulled.steps(99)
    pulled.step(best_at(9.0, START[0] + 0.4, START[1] - 0.6))
    x, y = pulled.vector("velocity")
    assert 0.0 < x < 0.4
    assert -0.6 < y < 0.0
    assert x / 0.4 != pytest.approx(y / -0.6), "each axis has a draw of its own"


def test_neighbour_best_is_the_brightest_received_so_far() -> None:
    robot = SingleParticle()
    robot.step(best_at(0.5, 0.0, 0.0), best_at(0.75, 3.0, 1.0), best_at(0.625, -3.0, 0.0))
    assert robot.memory.neighbour_brightness[0] == 0.75
    assert robot.vector("neighbour") == pytest.approx((2.0, 3.0))
    robot.step(best_at(0.6875, 0.0, 0.0))
    assert robot.vector("neighbour") == pytest.approx((2.0, 3.0))
    robot.step(best_at(0.75, 3.5, 1.0))
    assert robot.vector("neighbour") == pytest.approx((2.5, 3.0)), "as bright, and told anew"


def test_neighbour_best_darker_than_the_personal_best_has_no_effect() -> None:
    robot = SingleParticle(inertia=0.0)
    robot.brightness = 2.0
    robot.steps(100)
    robot.step(best_at(1.0, 3.0, 3.0))
    assert robot.vector("velocity") == (0.0, 0.0)


def test_personal_best_stays_at_the_brightest_position() -> None:
    robot = SingleParticle()
    robot.brightness = 0.8
    robot.step(best_at(0.9, 2.0, 2.0))
    robot.position, robot.brightness = (1.5, -1.0), 0.7
    robot.step()
    assert robot.vector("personal") == pytest.approx((-0.5, -1.0))
    assert robot.vector("neighbour") == pytest.approx((0.5, 3.0))
    robot.brightness = 0.81
    robot.step()
    assert robot.vector("personal") == (0.0, 0.0)


def test_dead_reckoning_follows_the_heading_and_ignores_turns() -> None:
    robot = SingleParticle(PsoSearch)
    robot.step(BestVector(brightness=0.9, x_m=1.0, y_m=0.0))
    robot.heading_rad = np.pi / 2.0
    robot.wheels_m = [4.9, 6.1]
    robot.step()
    assert robot.vector("neighbour") == pytest.approx((1.0, 0.0))
    robot.wheels_m = [5.1, 6.3]
    robot.step()
    assert robot.vector("neighbour") == pytest.approx((1.0, -0.2))
    assert robot.vector("personal") == pytest.approx((0.0, -0.2))


def test_best_vector_starts_at_range_and_bearing_of_its_sender() -> None:
    robot = SingleParticle(PsoSearch)
    robot.heading_rad = np.pi / 2.0
    robot.step(BestVector(brightness=0.9, x_m=1.0, y_m=0.5), range_m=2.0, bearing_rad=np.pi / 2.0)
    assert robot.vector("neighbour") == pytest.approx((-1.0, 0.5)), "the sender stands 2 m to the left: at (-2, 0)"


@pytest.mark.parametrize("kind", [PsoSearch, PsoSearchPositioned])
def test_personal_best_is_sent_once_per_period_a_second_before_its_end(kind: type[ParticleSwarm[Any]]) -> None:
    sent = [len(actions.sent) for actions in SingleParticle(kind).steps(300)]
    assert [tick for tick, packets in enumerate(sent) if packets] == [90, 190, 290]


def test_robot_turns_to_its_target_and_waits_there() -> None:
    robot = SingleParticle(**CALM)
    robot.step()
    x, y = robot.vector("target")
    robot.heading_rad = float(np.arctan2(y, x)) - 0.5
    actions = robot.step()
    assert actions.angular_radps[0] == pytest.approx(1.5)
    assert 0.0 < actions.linear_mps[0] < 0.1
    robot.position = (START[0] + x, START[1] + y)
    assert robot.step().linear_mps[0] == 0.0


@pytest.mark.parametrize(("ray", "side"), [(0, 1.0), (7, -1.0)])
def test_robot_turns_from_a_near_object_on_its_way_to_the_target(ray: int, side: float) -> None:
    """Ray 0 looks 17 degrees to the left, ray 7 as far to the right."""
    robot = SingleParticle()
    robot.step()
    robot.heading_rad = float(np.arctan2(*reversed(robot.vector("target"))))
    free = robot.step()
    assert free.angular_radps[0] == pytest.approx(0.0, abs=1e-9)
    robot.rays[ray] = 0.4
    actions = robot.step()
    assert np.sign(actions.angular_radps[0]) == -side
    assert actions.linear_mps[0] < free.linear_mps[0]


@pytest.mark.parametrize(
    ("count", "index", "width", "heeded"),
    [(10, 0, 1, 9), (10, 0, 4, 6), (10, 0, 5, 5), (10, 4, 1, 5), (10, 3, 1, 4), (10, 2, 2, 4), (0, 0, 1, 5)],
)
def test_ring_limits_neighbours_to_adjacent_indices(count: int, index: int, width: int, heeded: int) -> None:
    """Of senders 1 to 9 the nearer to 5 is the brighter, above 5 a little more so than below; no ring limits none."""
    robot = SingleParticle(ring_count=count, ring_index=index, ring_width=width)
    robot.step(*(best_at(8.0 - abs(sender - 5.1), float(sender), 0.0) for sender in range(1, 10)))
    assert robot.vector("neighbour")[0] == pytest.approx(heeded - 1.0)


@pytest.mark.parametrize(
    ("params", "key", "text"),
    [
        ({"ring_count": -1}, "ring_count", "expected at least 0, got -1"),
        ({"ring_count": 10, "ring_width": 0}, "ring_width", "expected at least 1, got 0"),
        ({"ring_count": 10}, "ring_index", "a list with the index in the arena of each robot, 0 to 9, got 0"),
        ({"ring_count": 2, "ring_index": [0, 1, 2]}, "ring_index", "0 to 1, got"),
        ({"ring_count": 3, "ring_index": [0, 1]}, "ring_index", "one for each of the 3 robots"),
    ],
)
def test_ring_parameters_are_checked_before_a_run(params: dict[str, Any], key: str, text: str) -> None:
    with pytest.raises(BadParameter, match=text) as caught:
        checked_parameters(PsoSearch, params, robots=3)
    assert caught.value.key == key


def test_ring_defaults_of_a_class_are_checked() -> None:
    ringed = type("Ringed", (PsoSearch,), {"__annotations__": {"ring_count": int}, "ring_count": 10})
    with pytest.raises(BadParameter, match="0 to 9, got 0"):
        checked_parameters(ringed, {}, robots=3)
    for params in ({"ring_index": [0, 1, 9]}, {"ring_count": 0}):
        assert checked_parameters(ringed, params, robots=3) == params
    assert checked_parameters(PsoSearch, {"ring_count": 3, "ring_index": 2})["ring_index"] == 2


def test_received_bests_expire_after_the_update_unless_kept() -> None:
    keeping, forgetting = SingleParticle(), SingleParticle(keeps_received=False)
    for robot in (keeping, forgetting):
        robot.steps(199)
        robot.step(best_at(9.0, 2.0, 2.0))
        assert robot.memory.neighbour_brightness[0] == 9.0
        robot.step()
    assert keeping.vector("velocity") == forgetting.vector("velocity")
    assert keeping.memory.neighbour_brightness[0] == 9.0
    assert forgetting.memory.neighbour_brightness[0] < 0.0


@pytest.mark.parametrize(("again_m", "brightness", "readings", "away_m"), [(AGAIN_M, 0.6, 3, 0.0), (0.0, 0.9, 1, 0.05)])
def test_readings_near_the_personal_best_are_averaged_at_its_position(
    again_m: float, brightness: float, readings: int, away_m: float
) -> None:
    """If it is measured again; else it is the brightest reading."""
    robot = SingleParticle(again_m=again_m)
    for x_m, value in ((0.0, 0.5), (0.05, 0.9), (0.09, 0.4)):
        robot.position, robot.brightness = (START[0] + x_m, START[1]), value
        robot.step()
    assert robot.memory.personal_brightness[0] == pytest.approx(brightness)
    assert robot.memory.personal_readings[0] == readings
    assert robot.vector("personal") == pytest.approx((away_m - 0.09, 0.0))


def test_personal_best_far_away_is_replaced_only_by_more_than_the_mean() -> None:
    robot = SingleParticle(again_m=AGAIN_M)
    for brightness in (0.9, 0.5):
        robot.brightness = brightness
        robot.step()
    robot.position, robot.brightness = (START[0] + 0.2, START[1]), 0.6
    robot.step()
    assert robot.memory.personal_readings[0] == 2
    robot.brightness = 0.8  # less than the best reading, more than the mean
    robot.step()
    assert robot.vector("personal") == (0.0, 0.0)
    assert (robot.memory.personal_brightness[0], robot.memory.personal_readings[0]) == (pytest.approx(0.8), 1)


@pytest.mark.parametrize(("again_m", "brightness"), [(AGAIN_M, (1.0 + 0.5) / 2.0), (0.0, 1.0)])
def test_personal_best_is_sent_with_the_mean_of_readings_on_return_if_measured_again(again_m, brightness) -> None:
    robot = SingleParticle(again_m=again_m, update_every_ticks=5, tell_before_ticks=1)
    robot.brightness = 1.0
    robot.step()
    robot.position, robot.brightness = (START[0] + 1.0, START[1]), 0.1
    robot.steps(2)
    robot.position, robot.brightness = START, 0.5
    robot.step()
    robot.position, robot.brightness = (START[0] + 0.5, START[1]), 0.1
    (payload,) = [actions.sent.payloads.row(0) for actions in robot.steps(1)]
    assert payload == best_at(brightness, *START).encode()


@pytest.mark.parametrize("heading_rad", [0.0, 2.0, -2.0])
@pytest.mark.parametrize("rays", [0.0, 1.0])
def test_particle_flies_straight_to_its_target_at_any_heading_through_objects(heading_rad: float, rays: float) -> None:
    robot = SingleParticle(PsoModel)
    robot.rays[:] = rays
    robot.step()
    robot.heading_rad = heading_rad
    actions = robot.step()
    forward, left = actions.linear_mps[0], actions.lateral_mps[0]
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    x, y = robot.vector("target")
    away_m = np.hypot(x, y)
    assert (forward * cos - left * sin, forward * sin + left * cos) == pytest.approx(
        (SPEED_MPS * x / away_m, SPEED_MPS * y / away_m)
    )
    assert actions.angular_radps[0] == 0.0


def test_particle_stops_at_its_target() -> None:
    robot = SingleParticle(PsoModel)
    robot.step()
    x, y = robot.vector("target")
    away_m = np.hypot(x, y)
    short_m = 0.4 * SPEED_MPS * PERIOD_S
    robot.position = (START[0] + x * (1.0 - short_m / away_m), START[1] + y * (1.0 - short_m / away_m))
    actions = robot.step()
    assert np.hypot(actions.linear_mps[0], actions.lateral_mps[0]) * PERIOD_S == pytest.approx(short_m)
    robot.position = (START[0] + x, START[1] + y)
    assert robot.step().linear_mps[0] == pytest.approx(0.0, abs=1e-9)
