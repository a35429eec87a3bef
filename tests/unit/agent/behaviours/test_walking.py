"""Behaviours that walk: random walks, avoidance, aggregation by a threshold."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import (
    Aggregation,
    BeaconAvoidance,
    Coverage,
    RandomWalk,
    SmoothedAvoidance,
    SmoothedAvoidanceProximity,
    ThresholdRule,
    ThresholdRuleProximity,
)
from swarmwire.agent.behaviours.aggregation import APPROACH, REPEL, WAIT, Beacon
from swarmwire.agent.behaviours.beacon_avoidance import SLOTS, NeighbourTable, Sightings, forget, remember
from swarmwire.agent.behaviours.beacon_avoidance import Beacon as BeaconPacket
from swarmwire.agent.behaviours.random_walk import Present
from swarmwire.agent.fields import Vectors
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.deploy import run
from tests.support.agent.behaviours import OneRobot, Walker

MANY = 4000
NEAR, FAR = (0.1, 0.4), (0.8, 0.4)
PERIOD_NS = 10**8
FOOTBOT, BURGER = load_body("footbot"), load_body("turtlebot3-burger")
SHOWN = Path(__file__).parents[4] / "scenarios" / "behaviours"
ON, BACK = (0.2, 0.0), (-0.1, 0.5)  # the article's numbers


@pytest.mark.parametrize("persistence", [0.0, 0.3, 0.8])
def test_persistence_is_the_mean_cosine_of_the_turns(persistence):
    turned = Walker(RandomWalk, n=MANY, persistence=persistence).first_turns_rad()
    assert np.mean(np.cos(turned)) == pytest.approx(persistence, abs=4.0 / MANY**0.5)
    assert np.mean(np.sin(turned)) == pytest.approx(0.0, abs=4.0 / MANY**0.5)


def test_persistence_of_one_never_turns_nor_from_an_obstacle_behind():
    walker = Walker(RandomWalk, n=20, persistence=1.0, spell_m=0.1)
    for _ in range(50):
        assert np.abs(walker.step().angular_radps).max() < 1e-12
    assert (Walker(RandomWalk, n=20, persistence=1.0).step(near_rad=np.pi).linear_mps == 0.1).all()


def test_spells_are_exponential_or_constant():
    random, fixed = (Walker(RandomWalk, n=MANY, spell_m=0.5, exponential=on) for on in (True, False))
    random.step()
    fixed.step()
    lengths = random.memory.remaining_m
    assert lengths.mean() == pytest.approx(0.5, rel=0.06)
    assert np.median(lengths) == pytest.approx(0.5 * np.log(2.0), rel=0.08)
    assert np.ptp(fixed.memory.remaining_m) <= 0.01 + 1e-12, "but for who has driven a step"


def test_spell_lasts_its_length_over_the_speed():
    walker = Walker(RandomWalk, spell_m=0.5, exponential=False, persistence=1.0)
    remaining_m = [walker.step() and float(walker.memory.remaining_m[0]) for _ in range(49)]
    assert remaining_m[0] == pytest.approx(0.49)
    assert remaining_m[-1] == pytest.approx(0.01)


@pytest.mark.parametrize("near_rad", [0.0, 0.9, -0.9])
def test_heading_after_an_obstacle_is_on_the_half_circle_away_from_it(near_rad):
    turned = Walker(RandomWalk, n=500, persistence=1.0).first_turns_rad(near_rad=near_rad)
    away = np.cos(turned - near_rad)
    assert away.max() < 0.35, "rays stand up to 40 degrees apart, so that their sum does not show quite where"
    assert away.min() < -0.95


def turns(*neighbours: tuple[float, float], **params: float) -> np.ndarray:
    return Walker(Coverage, Present, n=400, **params).first_turns_rad(*neighbours)


@pytest.mark.parametrize("bearing_rad", [0.0, 1.3, -2.0])
def test_coverage_never_turns_to_a_neighbour_within_the_repulsion_range(bearing_rad):
    assert np.cos(turns((0.9, bearing_rad)) - bearing_rad).max() < 0.0
    assert np.cos(turns((0.2, bearing_rad)) - bearing_rad).max() < -0.99
    assert np.cos(turns((2.0, bearing_rad)) - bearing_rad).max() > 0.9, "from farther chance has its say"


def test_coverage_repulsion_falls_with_the_distance_squared_and_adds_up():
    single = np.cos(turns((1.0, 0.0))).mean()
    assert np.cos(turns((2.0, 0.0))).mean() > single
    assert np.cos(turns(*[(2.0, 0.0)] * 4)).mean() == pytest.approx(single)
    assert np.cos(turns((2.0, 0.0), repulsion_m2=4.0)).mean() == pytest.approx(single)


def test_coverage_walks_at_random_without_packets_or_net_repulsion():
    for turned in (turns((1.0, 0.7), (1.0, 0.7 - np.pi)), turns()):
        assert abs(np.cos(turned).mean()) < 0.15
        assert abs(np.sin(turned).mean()) < 0.15


def test_coverage_broadcasts_in_every_step():
    walker = Walker(Coverage, Present, n=3)
    assert [len(walker.step().sent) for _ in range(3)] == [3, 3, 3]


def gatherers(n: int = 1, **params: float) -> Walker:
    return Walker(Aggregation, Beacon, n=n, **params)


@pytest.mark.parametrize("bearing_rad", [0.5, -2.0])
def test_aggregation_approaches_received_neighbours_and_waits_when_near(bearing_rad):
    robot = gatherers()
    assert robot.first_turns_rad((0.8, bearing_rad)) == pytest.approx([bearing_rad])
    assert (robot.memory.phase == APPROACH).all()
    actions = robot.step((0.1, bearing_rad))
    assert (robot.memory.phase == WAIT).all()
    assert (actions.linear_mps[0], actions.angular_radps[0]) == (0.0, 0.0)


def test_aggregation_approaches_the_majority_at_any_range():
    turned = gatherers().first_turns_rad((0.3, -1.0), (2.0, 1.0), (2.0, 1.0))
    assert 0.0 < turned[0] < 1.0


@pytest.mark.parametrize(
    ("neighbours", "crowding", "held"),
    [([], None, 1.0), ([NEAR], None, 4.0), ([NEAR] * 3, None, 16.0), ([FAR], None, 1.0), ([NEAR] * 3, 0.0, 1.0)],
)
def test_aggregation_leaves_less_often_with_more_near_neighbours(neighbours, crowding, held):
    """By the default crowding; with none their number does not matter."""
    params = {} if crowding is None else {"crowding": crowding}
    many = gatherers(MANY, leave_per_s=5.0, return_per_s=0.0, **params)
    many.step(NEAR)
    many.step(*neighbours)
    share = np.mean(many.memory.phase == REPEL)
    assert share == pytest.approx(1.0 - np.exp(-0.5 / held), abs=4.0 * (0.25 / MANY) ** 0.5)


def test_aggregation_repels_after_leaving_then_approaches_again():
    robot = gatherers(leave_per_s=1e9, crowding=0.0, return_per_s=0.0)
    robot.step(NEAR)
    robot.step(NEAR)
    assert (robot.memory.phase == REPEL).all()
    left_rad = float(robot.memory.turn_rad[0])
    back_rad = left_rad + 0.1 * 2.0 * np.sign(left_rad)  # with what it has turned by now
    assert np.cos(back_rad - 0.4) == pytest.approx(-1.0)
    many = gatherers(MANY, leave_per_s=1e9, return_per_s=2.0)
    many.step(NEAR)
    many.step(NEAR)
    many.step(FAR)
    assert np.mean(many.memory.phase == APPROACH) == pytest.approx(1.0 - np.exp(-0.2), abs=0.03)


class BeaconRobot(OneRobot):
    """One e-puck whose tests say what it hears: (range_m, bearing_rad, heading_rad, speed_mps) of neighbours."""

    def __init__(self, heading_rad: float = 0.0, **params: float) -> None:
        super().__init__(BeaconAvoidance, "epuck", **params)
        self.heading_rad = heading_rad

    def step(self, *beacons: tuple[float, float, float, float], late_ns: int = 0) -> tuple[float, float]:
        """Forward speed and turn rate; packets were received `late_ns` before the step."""
        messages = [BeaconPacket(heading_rad=float(h), speed_mps=v) for _, _, h, v in beacons]
        at = [(range_m, bearing_rad) for range_m, bearing_rad, _, _ in beacons]
        return self.command({"compass.heading_rad": self.heading_rad}, messages, at, late_ns)

    def steps(self, count: int) -> tuple[float, float]:
        return [self.step() for _ in range(count)][-1]

    def position(self) -> tuple[float, float]:
        return float(self.memory.x_m[0, 0]), float(self.memory.y_m[0, 0])


def test_beacon_avoidance_keeps_its_course_and_returns_to_it() -> None:
    assert BeaconRobot(2.0).steps(3) == (0.1, 0.0)
    robot = BeaconRobot(0.0)
    robot.step()
    robot.heading_rad = 0.5
    linear, angular = robot.step()
    assert angular == pytest.approx(-0.5 * 2.5)
    assert 0.0 < linear < 0.1


@pytest.mark.parametrize("heading_rad", [0.0, 2.0, -3.0])
def test_head_on_neighbour_is_passed_on_the_right_and_others_on_the_other_side(heading_rad: float) -> None:
    for bearing_rad, turn in ((0.0, -1.0), (0.2, -1.0), (-0.2, 1.0)):
        robot = BeaconRobot(heading_rad)
        assert np.sign(robot.step((0.6, bearing_rad, heading_rad + np.pi, 0.1))[1]) == turn


@pytest.mark.parametrize(
    ("beacon", "why"),
    [
        ((0.5, 1.5, 0.0, 0.1), "goes beside it, the same way"),
        ((0.5, 0.0, 0.0, 0.1), "goes before it, as fast"),
        ((0.5, np.pi, np.pi, 0.1), "has passed"),
        ((1.4, 0.0, np.pi, 0.1), "is seven seconds away"),
    ],
)
def test_neighbour_without_a_near_encounter_is_ignored(beacon: tuple[float, float, float, float], why: str) -> None:
    assert BeaconRobot().step(beacon) == pytest.approx((0.1, 0.0), abs=1e-6), why


def test_neighbour_is_extrapolated_then_forgotten() -> None:
    robot = BeaconRobot(np.pi / 2.0, memory_s=1.0, strength=0.0, close=0.0)
    robot.step()
    robot.step((1.0, 0.0, 0.0, 0.05))  # ahead is +y, the way it goes; the other goes to +x
    assert robot.position() == pytest.approx((0.0, 1.0), abs=1e-7)
    robot.steps(10)
    assert robot.position() == pytest.approx((0.05, 0.9), abs=1e-7)
    robot.step()
    assert (robot.memory.sender == NO_ROBOT).all()


def test_packet_is_extrapolated_by_its_age_and_the_known_latency() -> None:
    received, delayed = BeaconRobot(strength=0.0, close=0.0), BeaconRobot(strength=0.0, close=0.0, latency_s=1.5)
    for robot in (received, delayed):
        robot.step()
        robot.step((1.0, 0.0, np.pi, 0.1), late_ns=PERIOD_NS // 2)
    assert received.position() == pytest.approx((1.0 - 0.2 * 0.05, 0.0), abs=1e-7)
    assert delayed.position() == pytest.approx((1.0 - 0.2 * 1.55, 0.0), abs=1e-7)


def remember_all(
    table: NeighbourTable, row: list[int], sender: list[int], sequence: list[int], x_m: FloatArray
) -> None:
    zeros = np.zeros(len(row))
    where, still = Vectors(x_m, zeros), Vectors(zeros, zeros)
    remember(table, Sightings(np.array(row), np.array(sender), np.array(sequence), where, still, zeros))


def test_neighbour_table_keeps_the_nearest_if_slots_run_out() -> None:
    table, many = NeighbourTable.fresh(2), SLOTS + 5
    remember_all(table, [1] * many, list(range(many)), [0] * many, np.linspace(2.0, 0.5, many))
    assert table.sender[1].tolist() == list(range(many - 1, many - 1 - SLOTS, -1))
    assert (table.sender[0] == NO_ROBOT).all()
    remember_all(table, [1], [99], [0], np.array([0.1]))
    assert table.sender[1, :2].tolist() == [99, many - 1]
    assert table.sender[1, -1] == many - SLOTS + 1, "the farthest gave way"


def test_neighbour_table_keeps_the_newest_packet_of_a_sender() -> None:
    table = NeighbourTable.fresh(1)
    remember_all(table, [0, 0], [3, 3], [7, 5], np.array([0.7, 0.5]))
    remember_all(table, [0], [3], [6], np.array([0.6]))
    assert (table.sender[0, :2].tolist(), table.x_m[0, 0]) == ([3, NO_ROBOT], 0.7)
    forget(table, -1.0)
    assert table.age_s.tolist() == [[np.inf] * SLOTS]


class Alone(OneRobot):
    """One robot whose tests say what its rays see."""

    def __init__(self, kind: type[VectorAgent], **params: float) -> None:
        super().__init__(kind, "turtlebot3-burger" if "scan" in kind.needs else "footbot", **params)

    def step(self, rays: FloatArray) -> tuple[float, float]:
        """Its command at these answers of its proximity rays."""
        return self.command({"proximity.value": rays})

    def sees(self, *things: tuple[float, float], wide_deg: float = 0.5) -> tuple[float, float]:
        """Its command where the scanner sees things, each at (angle_deg, range_m), so wide to either side."""
        range_m = np.full(360, np.inf)
        for angle_deg, far_m in things:
            assert BURGER.scan is not None
            off = np.rad2deg(np.angle(np.exp(1j * (BURGER.scan.angle_rad - np.deg2rad(angle_deg)))))
            range_m[np.abs(off) <= wide_deg] = far_m
        return self.command({"scan.range_m": range_m})


@pytest.mark.parametrize("angle_deg", [0.0, 90.0, 180.0, -90.0])
def test_threshold_rule_backs_off_left_from_objects_on_any_side(angle_deg: float) -> None:
    robot = Alone(ThresholdRule)
    assert robot.sees() == ON
    assert robot.sees((angle_deg, 0.49)) == BACK
    assert robot.sees((angle_deg, 0.51)) == ON, "nothing is remembered"
    other = Alone(ThresholdRule, safe_m=0.3, speed_mps=0.15, back_mps=0.05, turn_radps=-1.0)
    assert (other.sees((angle_deg, 0.31)), other.sees((angle_deg, 0.29))) == ((0.15, 0.0), (-0.05, -1.0))


def rays(*distances: tuple[int, float]) -> FloatArray:
    """Answers of a foot-bot's rays that see something at a distance from the rim."""
    value = np.zeros(24)
    assert FOOTBOT.proximity is not None
    for ray, far_m in distances:
        value[ray] = FOOTBOT.proximity.response.value(np.array(far_m))
    return value


@pytest.mark.parametrize("ray", [0, 7, 12, 23])
def test_threshold_of_proximity_rays_is_from_the_rim(ray: int) -> None:
    robot = Alone(ThresholdRuleProximity, safe_m=0.05)
    assert robot.step(rays()) == (0.1, 0.0), "rays that see nothing are not at their reach"
    assert robot.step(rays((ray, 0.045))) == (-0.05, 0.5)
    assert robot.step(rays((ray, 0.055))) == (0.1, 0.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_smoothed_avoidance_turns_away_and_never_drives_backwards(side: float) -> None:
    scanner, short = Alone(SmoothedAvoidance), Alone(SmoothedAvoidanceProximity)
    ray = 1 if side > 0.0 else 22  # at 22.5 degrees
    for _ in range(20):
        by_scanner = scanner.sees((side * 30.0, 0.3), wide_deg=20.0)
        by_rays = short.step(rays((ray, 0.02)))
        for linear, angular in (by_scanner, by_rays):
            assert linear >= 0.0
            assert np.sign(angular) == -side


def test_smoothed_avoidance_drives_straight_between_equally_near_walls() -> None:
    robot = Alone(SmoothedAvoidance)
    commands = [robot.sees((90.0, 0.3), (-90.0, 0.3), wide_deg=40.0) for _ in range(30)]
    assert commands[-1] == pytest.approx(ON, abs=1e-3)


def test_smoothed_avoidance_accelerates_with_its_time_constant() -> None:
    robot = Alone(SmoothedAvoidance, smooth_s=0.3)
    linear = [robot.sees()[0] for _ in range(3)]
    assert linear == pytest.approx([0.2 * (1.0 - 0.75**step) for step in (1, 2, 3)])
    assert Alone(SmoothedAvoidance, smooth_s=0.0).sees() == ON


def test_smoothed_avoidance_keeps_its_side_while_blocked() -> None:
    """What is ahead seems now a little to the left, now a little to the right."""
    steady, fickle = (Alone(SmoothedAvoidance, smooth_s=0.0, **more) for more in ({}, {"blocked_rad": 4.0}))
    where = [3.0, -3.0, 3.0, -3.0]
    assert {np.sign(steady.sees((angle, 0.25), wide_deg=40.0)[1]) for angle in where} == {-1.0}
    assert {np.sign(fickle.sees((angle, 0.25), wide_deg=40.0)[1]) for angle in where} == {-1.0, 1.0}
    assert steady.sees() == ON, "nothing is in its way any more"
    assert steady.sees((-3.0, 0.25), wide_deg=40.0)[1] > 0.0, "and the side is chosen anew"


def test_smoothed_avoidance_prevents_contacts_of_the_threshold_rule() -> None:
    contacts = {
        name: run(SHOWN / f"{name}_proximity.toml", overrides=["duration_s=20"]).metrics["collisions"].final
        for name in ("threshold_rule", "smoothed_avoidance")
    }
    assert contacts["smoothed_avoidance"] == 0.0
    assert contacts["threshold_rule"] is not None
    assert contacts["threshold_rule"] > 0.0
