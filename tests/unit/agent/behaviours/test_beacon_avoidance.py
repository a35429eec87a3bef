"""Beacon avoidance: what a robot remembers of its neighbours, how it steers, and that swarms meet less by it."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import BeaconAvoidance
from swarmwire.agent.behaviours.beacon_avoidance import Beacon, Traffic
from swarmwire.agent.behaviours.neighbour_table import NO_ROBOT, SLOTS, Remembered, forget, remember
from swarmwire.agent.fields import Vectors
from swarmwire.agent.host import agent_group
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.packets import Payloads, ReceivedPackets
from swarmwire.comms.tick_io import GroupReadings
from swarmwire.deploy import run
from tests.support.agent.hosts import group

SCENARIO = Path(__file__).parents[4] / "scenarios" / "behaviours" / "beacon_avoidance.toml"
PERIOD_NS = 10**8


class One:
    """One e-puck whose tests say what it hears: (range_m, bearing_rad, heading_rad, speed_mps) of neighbours."""

    def __init__(self, heading_rad: float = 0.0, **params: float) -> None:
        self.tick, self.heading_rad = 0, heading_rad
        self._host = agent_group(group("", [0], params=dict(params)), BeaconAvoidance)

    def step(self, *beacons: tuple[float, float, float, float], late_ns: int = 0) -> tuple[float, float]:
        """Forward speed and turn rate; packets were received `late_ns` before the step."""
        table = np.array(beacons, np.float64).reshape(-1, 4)
        k, now_ns = len(table), self.tick * PERIOD_NS
        payloads = Payloads.of([Beacon(heading_rad=h, speed_mps=v).encode() for _, _, h, v in table.tolist()])
        zeros, given = np.zeros(k, np.int64), {"range_m": table[:, 0], "bearing_rad": table[:, 1]}
        at_ns, order = np.full(k, now_ns - late_ns), np.full(k, self.tick)
        received = ReceivedPackets(zeros, np.arange(1, k + 1), order, at_ns, given, np.arange(k), payloads)
        readings = GroupReadings(np.zeros(1, np.int64), {"compass.heading_rad": np.array([self.heading_rad])})
        actions = self._host.act((self.tick, now_ns, PERIOD_NS), readings, received)
        self.tick += 1
        return float(actions.linear_mps[0]), float(actions.angular_radps[0])

    def steps(self, count: int) -> tuple[float, float]:
        return [self.step() for _ in range(count)][-1]

    @property
    def known(self) -> Traffic:
        return self._host._state

    def place(self) -> tuple[float, float]:
        return float(self.known.x_m[0, 0]), float(self.known.y_m[0, 0])


def test_alone_a_robot_goes_straight_on() -> None:
    assert One(2.0).steps(3) == (0.1, 0.0)


def test_a_robot_that_was_turned_goes_back_to_its_course() -> None:
    one = One(0.0)
    one.step()
    one.heading_rad = 0.5
    linear, angular = one.step()
    assert angular == pytest.approx(-0.5 * 2.5)
    assert 0.0 < linear < 0.1


@pytest.mark.parametrize("heading_rad", [0.0, 2.0, -3.0])
def test_who_comes_head_on_is_passed_on_the_right(heading_rad: float) -> None:
    one = One(heading_rad)
    assert one.step((0.6, 0.0, heading_rad + np.pi, 0.1))[1] < 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_would_pass_at_one_side_is_passed_on_the_other(side: float) -> None:
    assert np.sign(One().step((0.6, side * 0.2, np.pi, 0.1))[1]) == -side


@pytest.mark.parametrize(
    ("beacon", "why"),
    [
        ((0.5, 1.5, 0.0, 0.1), "goes beside it, the same way"),
        ((0.5, 0.0, 0.0, 0.1), "goes before it, as fast"),
        ((0.5, np.pi, np.pi, 0.1), "has passed"),
        ((1.4, 0.0, np.pi, 0.1), "is seven seconds away"),
    ],
)
def test_who_will_not_be_met_soon_turns_nobody(beacon: tuple[float, float, float, float], why: str) -> None:
    assert One().step(beacon) == pytest.approx((0.1, 0.0), abs=1e-6), why


def test_a_neighbour_is_remembered_where_it_should_be_by_now_and_then_forgotten() -> None:
    one = One(np.pi / 2.0, memory_s=1.0, strength=0.0, close=0.0)
    one.step()
    one.step((1.0, 0.0, 0.0, 0.05))  # ahead is +y, the way it goes; the other goes to +x
    assert one.place() == pytest.approx((0.0, 1.0), abs=1e-7)
    one.steps(10)
    assert one.place() == pytest.approx((0.05, 0.9), abs=1e-7)
    one.step()
    assert (one.known.sender == NO_ROBOT).all()


def test_a_packet_is_moved_on_by_its_age_and_by_a_delay_that_is_known() -> None:
    received, delayed = One(strength=0.0, close=0.0), One(strength=0.0, close=0.0, latency_s=1.5)
    for one in (received, delayed):
        one.step()
        one.step((1.0, 0.0, np.pi, 0.1), late_ns=PERIOD_NS // 2)
    assert received.place() == pytest.approx((1.0 - 0.2 * 0.05, 0.0), abs=1e-7)
    assert delayed.place() == pytest.approx((1.0 - 0.2 * 1.55, 0.0), abs=1e-7)


def told(table: Remembered, row: list[int], sender: list[int], sequence: list[int], x_m: FloatArray) -> None:
    zeros = np.zeros(len(row))
    where, still = Vectors(x_m, zeros), Vectors(zeros, zeros)
    remember(table, np.array(row), np.array(sender), np.array(sequence), where, still, zeros)


def test_of_more_than_there_are_slots_for_the_nearest_are_remembered() -> None:
    table, many = Remembered.fresh(2), SLOTS + 5
    told(table, [1] * many, list(range(many)), [0] * many, np.linspace(2.0, 0.5, many))
    assert table.sender[1].tolist() == list(range(many - 1, many - 1 - SLOTS, -1))
    assert (table.sender[0] == NO_ROBOT).all()
    told(table, [1], [99], [0], np.array([0.1]))
    assert table.sender[1, :2].tolist() == [99, many - 1]
    assert table.sender[1, -1] == many - SLOTS + 1, "the farthest gave way"


def test_of_a_sender_the_newest_packet_counts_also_if_an_older_one_comes_later() -> None:
    table = Remembered.fresh(1)
    told(table, [0, 0], [3, 3], [7, 5], np.array([0.7, 0.5]))
    told(table, [0], [3], [6], np.array([0.6]))
    assert (table.sender[0, :2].tolist(), table.x_m[0, 0]) == ([3, NO_ROBOT], 0.7)
    forget(table, -1.0)
    assert table.age_s.tolist() == [[np.inf] * SLOTS]


@pytest.mark.parametrize("trial", [Trial(seed=1, ticks=25), Trial(seed=2, robots=14, ticks=25)], ids=repr)
def test_each_robot_decides_alone(trial: Trial) -> None:
    assert_rows_independent(BeaconAvoidance, trial)


def test_crossing_traffic_meets_without_the_radio_and_not_with_it() -> None:
    short = ["duration_s=20"]
    received, unheard = (
        run(SCENARIO, seeds=[2], overrides=o).arenas[0].metrics["collisions"].final
        for o in (short, [*short, "radio.loss=1.0"])
    )
    assert received == 0.0
    assert unheard not in (0.0, None)
