"""Behaviours in which robots follow their neighbours: flocking and consensus."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import Consensus, LennardJonesFlocking, MinimalistFlocking
from swarmwire.agent.behaviours.consensus import Value
from swarmwire.agent.behaviours.lennard_jones_flocking import Here
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key, purpose, uniform
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.deploy import Simulation, run
from tests.support.agent.behaviours import OneRobot

PAPER = Path(__file__).parents[4] / "scenarios" / "papers" / "scenarios" / "vicsek.toml"
SIDE_M, RANGE_M, WAY_M = 5.0, 1.0, 0.03
SHORT = ["duration_s=20"]
CONSENSUS_PAPER = Path(__file__).parents[4] / "scenarios" / "papers" / "scenarios" / "consensus.toml"
FULL, RING = "radio.range_m=3", "radio.range_m=0.8"
BASE_M, MAX_MPS = 0.14, 0.1
SCENARIO = Path("scenarios/behaviours/lennard_jones_flocking.toml")
RAYS = load_body("flockbot").proximity
assert RAYS is not None
RESPONSE = RAYS.response
DIAMETER_M = 0.07
ANGLES = [-30, 0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300]
STRAIGHT, LEFT, RIGHT = (0.1, 0.0), (0.0, 2.0), (0.0, -2.0)
Distances = dict[int, float]  # angle of a ray in degrees: distance in diameters
NOTHING: Distances = {}


def wrapped(x: FloatArray, side: float) -> FloatArray:
    return x - side * np.round(x / side)


def neighbours(place_m: FloatArray, range_m: float) -> FloatArray:
    """1 where two of the particles (n, 2) are in range on the torus, each of itself, too; (n, n)."""
    apart = wrapped(place_m[:, None, :] - place_m[None, :, :], SIDE_M)
    return (np.hypot(apart[..., 0], apart[..., 1]) <= range_m).astype(np.float64)


def next_step(
    place_m: FloatArray, theta: FloatArray, noise: FloatArray, way_m: float = WAY_M
) -> tuple[FloatArray, ...]:
    """Vicsek et al. (1995), equations 1 and 2: places and directions one step on, both from those of now."""
    near = neighbours(place_m, RANGE_M)
    mean = np.arctan2(near @ np.sin(theta), near @ np.cos(theta))
    moved = place_m + way_m * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    return wrapped(moved, SIDE_M), mean + noise


def noise_of(simulation: Simulation, tick: int, noise_rad: float) -> FloatArray:
    """What the particles draw in a tick, by the keys of their draws."""
    keys = np.array([derive_key("robot", simulation.plan.static.seeds[0], i) for i in range(100)], np.uint64)
    return noise_rad * (uniform(keys, tick, 0, 0, purpose("noise of the direction")) - 0.5)


def off(a: FloatArray, b: FloatArray) -> float:
    return float(np.abs(wrapped(a - b, 2.0 * np.pi)).max())


@pytest.mark.parametrize("noise_rad", [0.0, 1.0, 5.0])
def test_vicsek_tick_equals_a_step_of_the_model_for_the_same_noise(noise_rad: float) -> None:
    """But for rounding, which grows where neighbours nearly cancel."""
    with Simulation(PAPER, overrides=[*SHORT, f"robots.particles.params.noise_rad={noise_rad}"]) as simulation:
        world = simulation.world
        place_m = world.pose[:, :2].copy()
        # Nothing is received in the first tick, so it only turns each by its noise.
        theta = world.pose[:, 2] + noise_of(simulation, 0, noise_rad)
        for tick in range(20):
            simulation.step()
            assert off(world.pose[:, 2], theta) < 1e-7  # the heading at a tick's end is the direction of its step
            place_m, theta = next_step(place_m, theta, noise_of(simulation, tick + 1, noise_rad))
            assert np.abs(wrapped(world.pose[:, :2] - place_m, SIDE_M)).max() < 1e-7
    assert np.count_nonzero(neighbours(place_m, RANGE_M)) > 300  # of 100 that would hear themselves alone


def test_vicsek_ignores_lost_packets() -> None:
    """So with every packet lost nobody turns but by noise, of which there is none."""
    result = run(PAPER, overrides=[*SHORT, "robots.particles.params.noise_rad=0", "radio.loss=1"])
    metric = result.metrics["order"]
    assert metric.min == pytest.approx(metric.max, abs=1e-12)


def consensus_value(*others: float, **params: float) -> float:
    """What a robot comes to that starts with 1 and hears these numbers in its first step."""
    robot = OneRobot(Consensus, "point", **{"start": 1.0, **params})
    actions = robot.act({}, [Value(value=other) for other in others])
    (payload,) = (actions.sent.payloads.row(row) for row in range(len(actions.sent)))
    (value,) = actions.values.value.tolist()
    assert Value.decode(payload).value == value  # what it says to others is what it tells
    return value


@pytest.mark.parametrize(
    ("others", "gain", "value"),
    [((), 0.1, 1.0), ((2.0,), 0.1, 1.1), ((2.0, 4.0), 0.1, 1.4), ((1.0, 1.0), 0.1, 1.0), ((2.0,), 1.0, 2.0)],
)
def test_consensus_adds_a_share_of_each_difference(others: tuple[float, ...], gain: float, value: float) -> None:
    assert consensus_value(*others, gain=gain) == pytest.approx(value)


def test_consensus_draws_first_values_around_the_start() -> None:
    assert consensus_value(start_width=0.0) == 1.0
    assert 0.75 <= consensus_value(start_width=0.5) <= 1.25
    assert consensus_value(start_width=0.5) != 1.0


@pytest.mark.parametrize(("graph", "eigenvalue"), [(RING, 2.0 - 2.0 * np.cos(0.2 * np.pi)), (FULL, 10.0)])
def test_consensus_without_losses_decays_by_the_eigenvalue_to_the_average(graph, eigenvalue) -> None:
    result = run(CONSENSUS_PAPER, overrides=[graph, "duration_s=2"])
    steps = 19  # told in ticks 0 to 19
    assert result.metrics["first_pattern"].final == pytest.approx((1.0 - 0.05 * eigenvalue) ** steps, rel=1e-6)
    assert result.metrics["consensus_bias"].final == pytest.approx(0.0, abs=1e-12)


def test_consensus_diverges_for_a_gain_above_two_over_the_eigenvalue() -> None:
    def error(gain: float) -> float:
        result = run(CONSENSUS_PAPER, overrides=[FULL, "duration_s=16", f"robots.nodes.params.gain={gain}"])
        return result.metrics["consensus_error"].final or 0.0

    assert error(0.19) < 1e-6
    assert error(0.21) > 1.0


def test_consensus_average_shifts_with_one_way_losses() -> None:
    result = run(CONSENSUS_PAPER, overrides=[RING, "radio.loss=0.5"], seeds=range(1, 9))
    final = [arena.metrics["consensus_bias"].final or 0.0 for arena in result.arenas]
    assert 0.01 < np.std(final) < 0.2


class LennardJonesRobot(OneRobot):
    """A foot-bot; `step` gives it neighbours (range in m, bearing in degrees), and returns its left and right wheel."""

    def __init__(self, **params: float) -> None:
        super().__init__(LennardJonesFlocking, "footbot", **params)

    def step(self, *neighbours: tuple[float, float], light_ray: int | None = None) -> tuple[float, float]:
        light = np.where(np.arange(24) == light_ray, 0.4, 0.0)
        at = [(range_m, np.deg2rad(bearing_deg)) for range_m, bearing_deg in neighbours]
        forward, turn = self.command({"light.value": light}, [Here()] * len(at), at)
        return forward - 0.5 * BASE_M * turn, forward + 0.5 * BASE_M * turn


def wheels(*neighbours: tuple[float, float], **params: float) -> tuple[float, float]:
    return LennardJonesRobot(**params).step(*neighbours)


@pytest.mark.parametrize("distance_cm", [40.0, 60.0, 74.0, 76.0, 90.0, 130.0])
def test_lennard_jones_force_equals_that_of_argos_in_other_units(distance_cm):
    ratio = (75.0 / distance_cm) ** 2
    in_cm = -1000.0 / distance_cm * (ratio * ratio - ratio)
    force = LennardJonesFlocking().force(np.array([distance_cm / 100.0]))
    assert force == pytest.approx([in_cm / 100.0])
    assert np.sign(force[0]) == np.sign(distance_cm - 75.0)


def test_lennard_jones_neighbour_attracts_between_the_target_distance_and_its_reach():
    assert wheels((0.75, 30.0)) == pytest.approx((0.0, 0.0), abs=1e-12)
    left, right = wheels((1.0, 0.0))
    assert left == right == pytest.approx(LennardJonesFlocking().force(np.array([1.0]))[0])
    assert wheels((1.36, 0.0)) == (0.0, 0.0)


def test_lennard_jones_near_neighbour_turns_the_robot_away():
    left, right = wheels((0.5, 0.0))
    assert left == -right
    assert abs(left) == pytest.approx(MAX_MPS)
    for range_m in (0.5, -0.01):  # noise may make it negative
        assert wheels((range_m, 180.0)) == pytest.approx((MAX_MPS, MAX_MPS))


def test_lennard_jones_mean_excludes_neighbours_out_of_reach():
    alone = wheels((1.0, 0.0))
    assert wheels((1.0, 0.0), (0.75, 90.0)) == pytest.approx(tuple(0.5 * speed for speed in alone))
    assert wheels((1.0, 0.0), (2.0, 90.0)) == pytest.approx(alone)


def test_soft_turn_begins_beyond_10_degrees():
    pull = LennardJonesFlocking().force(np.array([1.0]))[0]
    assert wheels((1.0, 9.0)) == pytest.approx((pull, pull))
    assert wheels((1.0, 45.0)) == pytest.approx((0.5 * pull, 1.5 * pull), rel=1e-4)
    assert wheels((1.0, -45.0)) == pytest.approx((1.5 * pull, 0.5 * pull), rel=1e-4)


def test_hard_turn_begins_beyond_90_degrees_and_lasts_until_70():
    robot, on_the_spot = LennardJonesRobot(), pytest.approx((-MAX_MPS, MAX_MPS))
    assert robot.step((1.0, 85.0)) != on_the_spot
    assert robot.step((1.0, 95.0)) == on_the_spot
    assert robot.step((1.0, 85.0)) == on_the_spot
    assert robot.step((1.0, 69.0)) != on_the_spot
    assert robot.step((1.0, 85.0)) != on_the_spot


def test_light_attracts_with_a_quarter_of_top_speed_unless_weight_is_zero():
    ahead = 0  # at 7.5 degrees
    assert LennardJonesRobot().step(light_ray=ahead) == pytest.approx((0.25 * MAX_MPS,) * 2)
    assert LennardJonesRobot(light=0.0).step(light_ray=ahead) == (0.0, 0.0)


def spread_m(*overrides: str) -> float:
    """The distance from a foot-bot to its nearest neighbour after 15 s, mean over robots."""
    options = ["metrics=['nearest_neighbour']", "duration_s=15", "robots.flock.place.radius_m=0.8", *overrides]
    final = run(SCENARIO, seeds=[1], overrides=options).metrics["nearest_neighbour"].final
    assert final is not None
    return final


def test_ten_robots_spread_to_the_target_distance_only_with_radio():
    assert 0.5 < spread_m("robots.flock.params={light=0.0}") < 0.85
    assert spread_m("robots.flock.params={light=0.0}", "radio.loss=1.0") < 0.4


def values(rays: Distances) -> np.ndarray:
    distance_m = np.array([rays.get(angle, np.inf) for angle in ANGLES]) * DIAMETER_M
    return np.where(np.isfinite(distance_m), RESPONSE.value(np.minimum(distance_m, 1.0)), 0.0)


class OneMinimalist(OneRobot):
    """A flockbot; `step` tells it what its rays see, in diameters, and returns speed and turn rate."""

    def __init__(self, **params: float) -> None:
        super().__init__(MinimalistFlocking, "flockbot", period_ns=10**7, **params)

    def step(self, robots: Distances = NOTHING, walls: Distances = NOTHING) -> tuple[float, float]:
        return self.command({"infrared.value": values(robots), "proximity.value": values({**walls, **robots})})


def command(robots: Distances = NOTHING, walls: Distances = NOTHING, **params: float) -> tuple[float, float]:
    return OneMinimalist(**params).step(robots, walls)


@pytest.mark.parametrize(("angle", "turn"), [(30, RIGHT), (-30, LEFT)])
def test_avoidance_turns_away_from_the_half_with_the_nearest_object(angle, turn):
    other = -angle
    assert command(walls={angle: 0.9}) == turn
    assert command(walls={angle: 0.8, 0: 0.5, other: 0.9}) == turn
    assert command(walls={angle: 1.1}) == STRAIGHT


@pytest.mark.parametrize("angle", [60, 90, 150, 180, 240, 300])
def test_avoidance_ignores_walls_outside_the_front(angle):
    assert command(walls={angle: 0.1}) == command() == STRAIGHT


def test_avoidance_keeps_its_side_until_the_front_is_free():
    robot = OneMinimalist()
    assert robot.step(walls={30: 0.9}) == RIGHT
    assert robot.step(walls={-30: 0.2, 30: 0.9}) == RIGHT
    assert robot.step() == STRAIGHT
    assert robot.step(walls={-30: 0.2, 30: 0.9}) == LEFT


def test_avoidance_draws_a_side_between_equal_halves():
    turns = set[tuple[float, float]]()
    for tick in range(20):
        robot = OneMinimalist()
        for _ in range(tick):
            robot.step()
        turns.add(robot.step(walls={0: 0.5}))
    assert turns == {LEFT, RIGHT}


@pytest.mark.parametrize(
    ("angle", "turn"), [(60, RIGHT), (90, RIGHT), (120, RIGHT), (240, LEFT), (270, LEFT), (300, LEFT)]
)
def test_separation_turns_away_from_a_near_robot_to_the_side(angle, turn):
    assert command({angle: 0.9}) == turn
    assert command({angle: 1.5}) == STRAIGHT  # neither too near nor astray


def test_separation_from_a_robot_in_front_keeps_its_side():
    robot = OneMinimalist(avoid_diameters=0.1)
    first = robot.step({0: 0.5})
    assert first in (LEFT, RIGHT)
    assert all(robot.step({angle: 0.5}) == first for angle in (30, -30, 0, 30, -30))


@pytest.mark.parametrize(("angle", "turn"), [(60, LEFT), (120, LEFT), (240, RIGHT), (300, RIGHT)])
def test_lateral_cohesion_turns_to_a_far_robot_to_the_side(angle, turn):
    assert command({angle: 2.1}) == turn
    assert command({angle: 4.9}) == turn
    assert command(walls={angle: 2.1}) == STRAIGHT


def test_lateral_cohesion_turns_to_the_side_with_more_rays():
    assert command({60: 2.5, 90: 2.5, 270: 2.1}) == LEFT
    assert command({60: 2.5, 240: 2.5, 270: 2.5}) == RIGHT
    assert command({60: 2.5, 270: 2.5, 180: 4.5}) == STRAIGHT


@pytest.mark.parametrize(("angle", "turn"), [(150, LEFT), (210, RIGHT)])
def test_rear_cohesion_needs_a_greater_distance_than_lateral_cohesion(angle, turn):
    assert command({angle: 4.1}) == turn
    assert command({angle: 3.9}) == STRAIGHT
    robot = OneMinimalist()
    robot.step({angle: 4.1})
    assert robot.step({360 - angle: 4.1}) == turn  # keeps its side


def test_minimalist_rules_apply_in_order():
    everything: Distances = {30: 0.9, 270: 0.9, 60: 2.5, 150: 4.5}
    assert command(everything) == RIGHT  # avoids
    assert command({**everything, 30: 1.5}) == LEFT  # keeps apart
    assert command({90: 0.9, 270: 0.2}) == RIGHT  # from the left before the right
    assert command({60: 2.5, 210: 4.5}) == LEFT  # to the side, before the rear


def test_random_turn_precedes_all_rules_with_its_probability():
    robot = OneMinimalist(random_turn=0.3)
    steps = [robot.step() for _ in range(1000)]
    turned = np.mean([step != STRAIGHT for step in steps])
    assert turned == pytest.approx(0.3, abs=0.06)  # four standard deviations
    assert {LEFT, RIGHT} <= set(steps)
    assert all(OneMinimalist(random_turn=1.0).step(walls={30: 0.1}) in (LEFT, RIGHT) for _ in range(3))
