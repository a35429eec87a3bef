"""A robot answers whoever controls the swarm, whatever else it does."""

import json
import threading

import pytest

from swarmwire.agent.drivers.driver import DriverLost
from swarmwire.agent.radios.control import ControlPoint
from swarmwire.comms.wire.robot_network import ESTOP, STATUS, STOPPED, ask_all
from tests.support.swarms import KEYS, peers
from tests.support.waiting import until


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
    with peers(3) as made:
        yield made


@pytest.fixture
def point(sessions):
    """Makes control points that end with the test."""
    made: list[ControlPoint] = []

    def of(place: int, robot: Robot) -> ControlPoint:
        made.append(ControlPoint(sessions[place], KEYS, f"flock-{place}", robot))
        made[-1].open()
        return made[-1]

    yield of
    for one in made:
        one.close()


def test_every_robot_is_stopped_at_once_and_says_so(sessions, point):
    robots = [Robot(), Robot()]
    for place, robot in enumerate(robots):
        point(place, robot)
    assert ask_all(sessions[2], KEYS, ESTOP, ["flock-0", "flock-1"], 20.0) == {"flock-0": STOPPED, "flock-1": STOPPED}
    assert [robot.stops for robot in robots] == [1, 1]


def test_a_robot_tells_its_state(sessions, point):
    point(0, Robot())
    replies = ask_all(sessions[2], KEYS, STATUS, ["flock-0"], 20.0)
    assert json.loads(replies["flock-0"] or "") == {"ticks": 7, "late": False}


def test_one_that_is_not_there_has_no_reply_and_holds_up_no_other(sessions, point):
    point(0, robot := Robot())
    until(lambda: ask_all(sessions[2], KEYS, STATUS, ["flock-0"], 20.0)["flock-0"])
    assert ask_all(sessions[2], KEYS, ESTOP, ["flock-1", "flock-0"], 0.2) == {"flock-1": None, "flock-0": STOPPED}
    assert robot.stops == 1


def test_a_stop_that_failed_is_told_as_it_is(sessions, point):
    point(0, Robot(DriverLost("no answer from 10.0.0.9")))
    replies = ask_all(sessions[2], KEYS, ESTOP, ["flock-0"], 20.0)
    assert replies == {"flock-0": "failed: no answer from 10.0.0.9"}


def test_another_question_is_refused_with_what_there_is(sessions, point):
    answers = point(0, robot := Robot())
    assert ask_all(sessions[2], KEYS, "dance", ["flock-0"], 20.0) == {"flock-0": "expected estop or status"}
    assert answers.counts() == {"questions_refused": 1}
    assert robot.stops == 0


def test_while_a_stop_takes_long_the_network_goes_on(sessions, point):
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


def test_who_comes_late_is_stopped_though_another_does_not_answer(sessions, point):
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


def test_it_is_there_as_long_as_it_is_open(sessions, point):
    present: list[str] = []
    watch = (
        sessions[1]
        .liveliness()
        .declare_subscriber(
            f"{KEYS.root}/alive/*", lambda token: present.append(f"{token.kind} {token.key_expr}"), history=True
        )
    )
    one = point(0, Robot())
    until(lambda: len(present) == 1)
    one.close()
    one.close()
    until(lambda: len(present) == 2)
    assert present == [f"SampleKind.{kind} {KEYS.alive('flock-0')}" for kind in ("PUT", "DELETE")]
    watch.undeclare()
