"""The world tells where its robots are, as a camera above a real arena would."""

import math
from contextlib import contextmanager

import numpy as np

from swarmwire.agent.radios.tracker import Tracker as RobotsTracker
from swarmwire.world.gateways.tracker import EmulatedTracker
from tests.support.clocks import FakeClock
from tests.support.metrics.truths import static
from tests.support.swarms import KEYS, peers
from tests.support.waiting import until

POSE = np.array([[1.0, 2.0, 0.5], [-1.0, 0.25, math.pi], [3.0, 0.0, -1.0]])
ALL = np.ones(3, np.bool_)


class DatedClock(FakeClock):
    """A clock with a date."""

    def utc_ns(self) -> int:
        return self.time_ns


@contextmanager
def seen(of, robots):
    """The world's tracker of a run, and a robot's that listens to it."""
    with peers(2) as (world, robot):
        listens = RobotsTracker(robot, KEYS, robots)
        listens.open()
        clock = DatedClock()
        tells = EmulatedTracker(world, KEYS, clock)
        tells.begin(of)
        yield tells, listens, clock, world
        tells.end()


def test_robots_alive_are_told_in_every_tick_with_the_date():
    of = static(3)
    with seen(of, of.robot_names) as (tells, listens, clock, _):
        alive = np.array([True, False, True])

        def told() -> bool:
            tells.tell(POSE, alive)
            return listens.pose("flock-2", clock.utc_ns()) is not None

        until(told)
        assert [listens.pose(name, clock.utc_ns()) for name in of.robot_names] == [
            tuple(POSE[0]),
            None,
            tuple(POSE[2]),
        ]
        clock.time_ns += 2_000_000_000
        assert listens.pose("flock-0", clock.utc_ns()) is None
        tells.tell(POSE + 1.0, alive)
        until(lambda: listens.pose("flock-2", clock.utc_ns()) == tuple(POSE[2] + 1.0))
        assert listens.counts() == {"poses_malformed": 0, "poses_of_unknown": 0}
        assert tells.counts() == {}


def test_of_several_arenas_the_first_is_told():
    of = static(1, arenas=3)
    with seen(of, of.robot_names) as (tells, listens, clock, _):

        def told() -> bool:
            tells.tell(POSE, ALL)
            return listens.pose("flock-0", clock.utc_ns()) is not None

        until(told)
        assert listens.pose("flock-0", clock.utc_ns()) == tuple(POSE[0])


def test_a_network_that_is_gone_is_counted_and_harms_no_run():
    of = static(3)
    with seen(of, of.robot_names) as (tells, _, _, world):
        world.close()
        tells.tell(POSE, ALL)
        assert tells.counts() == {"tracker_poses_refused": 3}
        tells.end()
