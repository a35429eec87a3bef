import os
from collections.abc import Iterator
from contextlib import suppress

import pytest

from swarmwire.agent.on_robot.guard import RUNS, STOPPED
from swarmwire.agent.on_robot.heartbeats import Heartbeats


@pytest.fixture
def ends() -> Iterator[tuple[int, int]]:
    beats, pipe = os.pipe()
    os.set_blocking(pipe, False)
    yield beats, pipe
    for end in (beats, pipe):
        with suppress(OSError):  # the test did
            os.close(end)


def _alone() -> None:
    raise AssertionError("the guard is there")


def test_each_tells_whether_the_robot_was_stopped_for_good(ends):
    beats, pipe = ends
    stopped = [False, True]
    beat = Heartbeats(pipe, lambda: stopped.pop(0), _alone)
    beat()
    beat()
    assert os.read(beats, 9) == RUNS + STOPPED


def test_a_guard_that_is_frozen_holds_up_nobody(ends):
    _, pipe = ends
    with suppress(BlockingIOError):
        while os.write(pipe, b"." * 4096):
            continue
    Heartbeats(pipe, lambda: False, _alone)()


def test_a_guard_that_is_gone_is_noticed(ends):
    beats, pipe = ends
    os.close(beats)
    alone: list[bool] = []
    Heartbeats(pipe, lambda: False, lambda: alone.append(True))()
    assert alone == [True]


def test_without_a_guard_nothing_happens():
    Heartbeats(None, lambda: False, _alone)()
