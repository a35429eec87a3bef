import json
import math
import struct
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.agent.radios.control import ControlPoint
from swarmwire.agent.radios.tracker import MAX_AGE_NS, Tracker
from swarmwire.agent.radios.zenoh_radio import range_bearing
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.wire.radio_bridge import Pose
from swarmwire.comms.wire.robot_network import ESTOP, STATUS, STOPPED, ask_all
from tests.support.clocks import FakeClock, until
from tests.support.swarms import KEYS, ROBOTS, KeptLog, meet, peers, radio, words

NOW_NS = 1_767_225_600 * NS_PER_S
metres = st.floats(-50, 50)
turns = st.floats(-7, 7)
poses = st.builds(Pose, metres, metres, turns)


def packed(pose: tuple[float, float, float], stamp_ns: int = NOW_NS) -> bytes:
    return struct.pack("<3dq", *pose, stamp_ns)


class DatedClock(FakeClock):
    """A clock whose date a test sets, too."""

    date_ns = NOW_NS

    def utc_ns(self) -> int:
        return self.date_ns


@given(poses, st.floats(0.01, 50), turns)
def test_range_and_bearing_lead_to_the_sender(receiver, range_m, direction_rad):
    sender = Pose(
        receiver.x_m + range_m * math.cos(direction_rad), receiver.y_m + range_m * math.sin(direction_rad), 0.0
    )
    distance_m, bearing_rad = range_bearing(receiver, sender)
    heading_rad = receiver.heading_rad + bearing_rad
    reached = receiver.x_m + distance_m * math.cos(heading_rad), receiver.y_m + distance_m * math.sin(heading_rad)
    assert reached == pytest.approx((sender.x_m, sender.y_m), abs=1e-9)
    assert distance_m >= 0
    assert -math.pi < bearing_rad <= math.pi


@given(poses, poses, metres, metres, turns)
def test_range_and_bearing_do_not_depend_on_the_frame(receiver, sender, x_m, y_m, turn_rad):
    c, s = math.cos(turn_rad), math.sin(turn_rad)

    def moved(pose: Pose) -> Pose:
        x, y = c * pose.x_m - s * pose.y_m + x_m, s * pose.x_m + c * pose.y_m + y_m
        return Pose(x, y, pose.heading_rad + turn_rad)

    before, after = range_bearing(receiver, sender), range_bearing(moved(receiver), moved(sender))
    assert after[0] == pytest.approx(before[0], abs=1e-9)
    if before[0] > 0.001:
        assert math.cos(after[1] - before[1]) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("heading_rad", [0.0, math.pi, -math.pi, 3 * math.pi])
def test_bearing_straight_behind_is_pi_never_minus_pi(heading_rad):
    behind = Pose(-math.cos(heading_rad), -math.sin(heading_rad), 0.0)
    _, bearing_rad = range_bearing(Pose(0.0, 0.0, heading_rad), behind)
    assert abs(bearing_rad) == pytest.approx(math.pi)
    assert bearing_rad > -math.pi
    assert range_bearing(Pose(0, 0, math.pi), Pose(1, 0, 0)) == (1, math.pi)


def put_pose(session, tracker: Tracker, robot: str, pose: tuple[float, float, float], stamp_ns: int = NOW_NS) -> None:
    """Put a pose until the tracker has it."""

    def has_pose() -> bool:
        session.put(KEYS.pose(robot), packed(pose, stamp_ns))
        return tracker.pose(robot, stamp_ns) == Pose(*pose)

    until(has_pose)


def test_newest_pose_counts_until_it_is_a_second_old():
    with peers(2) as (session, other):
        tracker = Tracker(session, KEYS, ROBOTS)
        tracker.open()
        assert tracker.pose("flock-1", NOW_NS) is None

        put_pose(other, tracker, "flock-1", (1.0, 2.0, 3.0))
        put_pose(other, tracker, "flock-1", (4.0, 5.0, 6.0), NOW_NS + 7)
        for shift_ns in (-MAX_AGE_NS, MAX_AGE_NS):
            assert tracker.pose("flock-1", NOW_NS + 7 + shift_ns) == (4.0, 5.0, 6.0)
            assert tracker.pose("flock-1", NOW_NS + 7 + shift_ns + (1 if shift_ns > 0 else -1)) is None
        assert tracker.pose("flock-2", NOW_NS) is None
        assert tracker.pose("stranger", NOW_NS) is None


def tracked(session, other, clock, of_receiver=(1.0, 1.0, math.pi / 2), of_sender=(1.0, 3.0, 0.0)) -> Tracker:
    """A tracker at flock-0 that has seen flock-0 and flock-1."""
    tracker = Tracker(session, KEYS, ROBOTS)
    tracker.open()
    put_pose(other, tracker, "flock-0", of_receiver, clock.utc_ns())
    put_pose(other, tracker, "flock-1", of_sender, clock.utc_ns())
    return tracker


def test_packets_have_range_and_bearing_of_the_tracker():
    with peers(2) as (session, other):
        log, clock = KeptLog(), DatedClock()
        tracker = tracked(session, other, clock)
        a = radio(session, "flock-0", clock, tracker=tracker, needs_pose=True, log=log)
        assert a.measures == ("range_m", "bearing_rad")
        assert a.needs == {"radio.range", "radio.bearing"}
        b = radio(other, "flock-1")
        meet(other, [a])
        b.send(words(1.0, 2.0))
        until(lambda: len(a._inbox._waiting) == 2)
        received, _ = a.received(0)
        assert received.measured["range_m"].tolist() == [2.0, 2.0]
        assert np.allclose(received.measured["bearing_rad"], 0.0)
        assert all(column.flags.c_contiguous for column in received.measured.values())
        assert [packet.distance_m for packet in log.received_packets] == [2.0, 2.0]
        assert {name: column.shape for name, column in a.received(0)[0].measured.items()} == {
            "range_m": (0,),
            "bearing_rad": (0,),
        }


def test_packet_without_a_fresh_pose_is_dropped_for_agents_that_need_it():
    with peers(2) as (session, other):
        log, clock = KeptLog(), DatedClock()
        tracker = tracked(session, other, clock)
        asks = radio(session, "flock-0", clock, tracker=tracker, needs_pose=True, log=log)
        b = radio(other, "flock-1")
        meet(other, [asks])
        clock.date_ns += MAX_AGE_NS + 1
        b.send(words(1.0))
        until(lambda: not len(asks.received(0)[0]) and asks.counts().get("packets_without_pose") == 1)
        assert [(packet.distance_m, packet.delivered) for packet in log.received_packets] == [(None, False)]
        asks.close()
        asks_not = radio(session, "flock-0", clock, tracker=tracker)
        meet(other, [asks_not])
        b.send(words(2.0))
        until(lambda: len(asks_not._inbox._waiting) == 1)
        received, _ = asks_not.received(0)
        assert np.isnan(received.measured["range_m"]).tolist() == [True]
        assert np.isnan(received.measured["bearing_rad"]).tolist() == [True]


class Robot:
    """A robot that can be controlled."""

    def __init__(self, fails: Exception | None = None, waits: threading.Event | None = None) -> None:
        self.stops, self._fails, self._waits = 0, fails, waits

    def estop(self) -> None:
        if self._waits:
            assert self._waits.wait(20)
        self.stops += 1
        if self._fails:
            raise self._fails

    def status(self):
        return {"ticks": 7, "late": False}


@pytest.fixture
def sessions():
    with peers(3) as opened:
        yield opened


@pytest.fixture
def point(sessions):
    """Makes control points that end with the test."""
    points: list[ControlPoint] = []

    def open_point(index: int, robot: Robot) -> ControlPoint:
        points.append(ControlPoint(sessions[index], KEYS, f"flock-{index}", robot))
        points[-1].open()
        return points[-1]

    yield open_point
    for opened_point in points:
        opened_point.close()


def test_emergency_stop_reaches_every_robot(sessions, point):
    robots = [Robot(), Robot()]
    for index, robot in enumerate(robots):
        point(index, robot)
    assert ask_all(sessions[2], KEYS, ESTOP, ["flock-0", "flock-1"], 20.0) == {"flock-0": STOPPED, "flock-1": STOPPED}
    assert [robot.stops for robot in robots] == [1, 1]


def test_robot_answers_with_its_status(sessions, point):
    point(0, Robot())
    replies = ask_all(sessions[2], KEYS, STATUS, ["flock-0"], 20.0)
    assert json.loads(replies["flock-0"] or "") == {"ticks": 7, "late": False}


def test_missing_robot_has_no_reply_and_delays_no_other(sessions, point):
    point(0, robot := Robot())
    until(lambda: ask_all(sessions[2], KEYS, STATUS, ["flock-0"], 20.0)["flock-0"])
    assert ask_all(sessions[2], KEYS, ESTOP, ["flock-1", "flock-0"], 0.2) == {"flock-1": None, "flock-0": STOPPED}
    assert robot.stops == 1


def test_failed_stop_is_reported(sessions, point):
    point(0, Robot(DriverLost("no answer from 10.0.0.9")))
    replies = ask_all(sessions[2], KEYS, ESTOP, ["flock-0"], 20.0)
    assert replies == {"flock-0": "failed: no answer from 10.0.0.9"}


def test_unknown_question_is_refused(sessions, point):
    answers = point(0, robot := Robot())
    assert ask_all(sessions[2], KEYS, "dance", ["flock-0"], 20.0) == {"flock-0": "expected estop or status"}
    assert answers.counts() == {"questions_refused": 1}
    assert robot.stops == 0


def test_slow_stop_does_not_block_the_network(sessions, point):
    go_on = threading.Event()
    point(0, robot := Robot(waits=go_on))
    arrived = threading.Event()
    subscriber = sessions[0].declare_subscriber("other/thing", lambda _: arrived.set())
    replies: dict[str, str | None] = {}
    asker = threading.Thread(target=lambda: replies.update(ask_all(sessions[2], KEYS, ESTOP, ["flock-0"], 20.0)))
    asker.start()

    def received() -> bool:
        sessions[1].put("other/thing", b"")
        return arrived.is_set()

    until(received)
    assert not replies
    go_on.set()
    asker.join()
    assert replies == {"flock-0": STOPPED}
    assert robot.stops >= 1
    subscriber.undeclare()


def test_robot_that_joins_late_is_stopped_while_another_hangs(sessions, point):
    go_on = threading.Event()
    point(0, Robot(waits=go_on))
    until(lambda: ask_all(sessions[2], KEYS, "hello", ["flock-0"], 20.0)["flock-0"])
    late = Robot()
    replies: dict[str, str | None] = {}
    both = ["flock-0", "flock-1"]
    asker = threading.Thread(target=lambda: replies.update(ask_all(sessions[2], KEYS, ESTOP, both, 20.0)))
    asker.start()
    point(1, late)
    until(lambda: late.stops)
    assert asker.is_alive()
    go_on.set()
    asker.join()
    assert replies == dict.fromkeys(both, STOPPED)


def test_control_point_is_alive_while_it_is_open(sessions, point):
    present: list[str] = []
    watch = (
        sessions[1]
        .liveliness()
        .declare_subscriber(
            f"{KEYS.root}/alive/*", lambda token: present.append(f"{token.kind} {token.key_expr}"), history=True
        )
    )
    control_point = point(0, Robot())
    until(lambda: len(present) == 1)
    control_point.close()
    control_point.close()
    until(lambda: len(present) == 2)
    assert present == [f"SampleKind.{kind} {KEYS.alive('flock-0')}" for kind in ("PUT", "DELETE")]
    watch.undeclare()
