"""Agents from elsewhere in real time, which waits for nobody: what robots do meanwhile, and what is counted."""

import signal
from collections.abc import Iterator

import pytest

from swarmwire.deploy import repeat
from swarmwire.world.crews.change import Change
from tests.integration.deploy.test_joining import LONG, interrupt, moving
from tests.integration.deploy.test_realtime import Watcher
from tests.support.deploy.joiners import Joiners

FACTOR = 5.0


@pytest.fixture
def joiners(tmp_path) -> Iterator[Joiners]:
    found = Joiners(tmp_path)
    yield found
    found.close()


@pytest.mark.parametrize("quantum", [None, 0.005])
def test_a_late_joiner_s_robots_stand_until_it_plays_them_and_stand_again_once_it_left(joiners, tmp_path, quantum):
    joiners.first = [("a", "--robots", "5")]
    watcher = Watcher(
        (lambda truth: len(moving(truth)) == 5, lambda: joiners.start("b", "--robots", "4")),
        (lambda truth: len(moving(truth)) == 9, lambda: joiners.send("b", signal.SIGINT)),
        (lambda truth: len(moving(truth)) == 5, interrupt),
    )
    result = joiners.run(
        LONG,
        "run.on_runner_loss=stand",
        "run.watchdog_s=1000",
        watcher=watcher,
        start_with=5,
        realtime=FACTOR,
        quantum=quantum,
        out=tmp_path / "run",
    )
    assert not watcher.steps
    assert joiners.told == [("joined", "a"), ("joined", "b"), ("left", "b")]
    assert result.mode == "realtime"
    assert result.counts["runners_joined_late"] == result.counts["runners_left"] == 1
    assert joiners.said("b")[0] == 130
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.result.ticks == result.ticks


def test_robots_of_a_killed_runner_coast_until_it_returns_and_no_watchdog_stops_them(joiners, tmp_path):
    joiners.first = [("a", "--robots", "5"), ("b", "--robots", "15")]
    lost: list[int] = []
    back: list[int] = []

    def changed(change: Change) -> None:
        if change.what == "lost":
            lost.append(change.tick)
        elif change.what == "returned":
            back.append(change.tick)

    joiners.on_change = changed
    watcher = Watcher(
        (lambda truth: len(moving(truth)) == 20, lambda: joiners.send("a", signal.SIGKILL)),
        (lambda truth: bool(lost) and truth.tick > lost[0] + 10, lambda: (joiners.said("a"), joiners.start("a"))),
        (lambda truth: bool(back) and (truth.command != watcher.truths[back[0]].command)[:5].any(), interrupt),
    )
    result = joiners.run(
        LONG, "run.on_runner_loss=coast", "run.watchdog_s=60", watcher=watcher, realtime=FACTOR, out=tmp_path / "run"
    )
    alone = [truth.command[:5] for truth in watcher.truths[lost[0] + 1 : back[0]]]
    assert len(alone) > 10
    assert all((command == alone[0]).all() for command in alone)
    assert alone[0].any(axis=1).all()
    assert joiners.told == [("joined", "a"), ("joined", "b"), ("lost", "a"), ("returned", "a")]
    assert result.realtime is not None
    assert not result.realtime.watchdog_stops
    assert repeat(tmp_path / "run").same


def test_the_watchdog_stops_robots_of_a_frozen_runner_which_is_lost_later_and_told_to_leave(joiners, tmp_path):
    joiners.first = [("a", "--robots", "5"), ("b", "--robots", "15")]
    lost: list[int] = []
    joiners.on_change = lambda change: lost.append(change.tick) if change.what == "lost" else None
    watcher = Watcher(
        (lambda truth: len(moving(truth)) == 20, lambda: joiners.send("a", signal.SIGSTOP)),
        (lambda truth: len(moving(truth)) == 15, lambda: None),
        (lambda truth: bool(lost) and truth.tick > lost[0] + 5, lambda: joiners.send("a", signal.SIGCONT)),
        (lambda _: joiners.processes["a"].poll() is not None, interrupt),
    )
    result = joiners.run(
        LONG,
        "run.on_runner_loss=wait",
        "run.watchdog_s=1",
        "run.runner_timeout_s=3",
        watcher=watcher,
        realtime=FACTOR,
        out=tmp_path / "run",
    )
    assert not watcher.steps
    assert joiners.changes[2].reason == "no answer for 3 s"
    assert result.realtime is not None
    assert {f"flock-{row}" for row in range(5)} <= result.realtime.watchdog_stops.keys()
    assert result.realtime.frames_dropped > 0
    code, said = joiners.said("a")
    assert (code, said.splitlines()[-1]) == (1, "the world let it go: no answer for 3 s")
    assert repeat(tmp_path / "run").same
