"""Runners that ask for robots, leave and come back: who gets what, and what is counted, in lockstep and real time."""

import sys
from typing import Any

import msgpack
import numpy as np
import pytest

from swarmwire.comms.base.errors import AgentFailed, Interrupted, RunnerLost
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.assignment import Assignment
from swarmwire.comms.wire.join import GroupInfo, SessionInfo
from swarmwire.comms.wire.limits import JoinLimits
from swarmwire.world.backends.join_policy import JoinPolicy, JoinRefused
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.realtime import RealTime
from swarmwire.world.backends.registry import OnLoss
from swarmwire.world.backends.runner_reports import NOT_READY, RunnerEvent
from tests.support.agent.hosts import assignment, group
from tests.support.world.locksteps import FLOCK, SCOUTS, parts, ready, request, state

Made = Lockstep | RealTime
AGENTS = {"flock": "a" * 64, "scouts": "b" * 64, "lone": "c" * 64}
OFFER = SessionInfo(
    "RUN",
    "about",
    "d" * 64,
    "1.2.3",
    10,
    None,
    tuple(GroupInfo(name, "mine.py:Mine", sha256, 0, ()) for name, sha256 in AGENTS.items()),
)
OPEN = JoinPolicy(OFFER, open=True)
LEAVE = frames.encode("leave", -1, {})


def whole() -> list[Assignment]:
    return parts(dict.fromkeys(range(8), 0))


def made(kind: str, on_loss: OnLoss = "stand", policy: JoinPolicy = OPEN) -> Made:
    if kind == "lockstep":
        return Lockstep(whole(), on_loss, policy)
    return RealTime(whole(), 0.5, 30.0, on_loss, policy)


@pytest.fixture(params=["lockstep", "real time"])
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def roster(kind: str) -> Made:
    return made(kind)


def asked(roster: Made, runner: str, **wanted: Any) -> Assignment:
    return Assignment.from_mapping(msgpack.unpackb(roster.join(runner, request(**wanted))))


def rows(assignment: Assignment) -> dict[str, list[int]]:
    return {group.name: group.rows.tolist() for group in assignment.groups}


def free(roster: Made) -> dict[str, tuple[str, ...]]:
    session_info = roster.session_info()
    assert session_info is not None
    return {group.name: group.free for group in session_info.groups if group.free}


def test_so_many_robots_are_the_next_that_are_free_in_their_order(roster: Made) -> None:
    assert rows(asked(roster, "a", robots=3)) == {"flock": [0, 1], "scouts": [2]}
    assert rows(asked(roster, "b", robots=1)) == {"lone": [3]}
    assert free(roster) == {"flock": ("flock-4", "flock-5"), "scouts": ("scouts-6",), "lone": ("lone-7",)}
    assert rows(asked(roster, "c", robots=4)) == {"flock": [4, 5], "scouts": [6], "lone": [7]}
    assert free(roster) == {}
    assert not roster.counts()


def test_robots_may_be_named_and_whoever_names_none_gets_the_rest(roster: Made) -> None:
    got = asked(roster, "a", names=["lone-7", "flock-1"])
    assert rows(got) == {"flock": [1], "lone": [7]}
    assert [group.robot_names for group in got.groups] == [("flock-1",), ("lone-7",)]
    assert rows(asked(roster, "b")) == {"flock": [0, 4, 5], "scouts": SCOUTS, "lone": [3]}


def test_missing_robots_of_several_lost_processes_go_to_the_next_runner(kind: str) -> None:
    roster = made(kind, "wait")
    asked(roster, "a")
    ready(roster, "a")
    for row in (1, 7):
        process = {"process": str(row), "reason": "killed"}
        roster.answer("a", frames.encode("lost", -1, {"rows": np.array([row])}, process))
    with pytest.raises(JoinRefused, match=r"the name a is in use, .*flock-0, flock-4, .*: join under another name"):
        asked(roster, "a")
    assert rows(asked(roster, "b")) == {"flock": [1], "lone": [7]}


def test_what_is_cut_has_its_own_parameters_and_keys() -> None:
    assignment = parts(dict.fromkeys(range(8), 0))
    flock = assignment[0].groups[0]
    flock.params["lane"] = [10, 11, 14, 15]
    lockstep = Lockstep(assignment, "stand", OPEN)
    got = asked(lockstep, "a", names=["flock-4", "flock-1"]).groups[0]
    assert got.params == {"lane": [11, 14]}
    assert got.keys.tolist() == flock.keys[[1, 2]].tolist()
    for name in ("flock-0", "flock-5"):  # of two parts, once these have left
        asked(lockstep, name, names=[name])
    for runner in ("flock-5", "a"):
        lockstep.answer(runner, LEAVE)
    again = asked(lockstep, "b", names=["flock-1", "flock-5"]).groups[0]
    assert (again.rows.tolist(), again.params) == ([1, 5], {"lane": [11, 15]})
    assert again.keys.tolist() == flock.keys[[1, 3]].tolist()


@pytest.mark.parametrize(
    ("wanted", "why"),
    [
        ({"names": ["flock-4", "flock-0", "flock-1"]}, "taken, by a: flock-0, flock-1"),
        ({"names": ["flock-9"]}, "expected names of robots, each once .*, got flock-9"),
        ({"names": ["flock-4", "flock-4"]}, "each once"),
        ({"robots": 6}, "expected at most 5 robots, which are free, got 6"),
        ({"robots": 5}, "expected at most 4 robots for one runner, got 5"),
        ({}, "expected at most 4 robots for one runner, got 5"),
        ({"robots": 2, "agents": {}}, r"another agent for .*: mine.py:Mine has sha256 .* the runner's own has none"),
        (
            {"names": ["flock-4"], "agents": {**AGENTS, "flock": "e" * 64}},
            "another agent for flock: .* has eeeeeeeeeeee…",
        ),
        ({"scenario_sha256": "e" * 64}, "another scenario: here is 'about'"),
    ],
    ids=repr,
)
def test_what_cannot_be_had_is_refused_counted_and_changes_nothing(kind: str, wanted: dict[str, Any], why: str) -> None:
    roster = made(kind, policy=JoinPolicy(OFFER, open=True, limits=JoinLimits(robots_per_runner=4)))
    asked(roster, "a", robots=3)
    before = state(roster)
    with pytest.raises(JoinRefused, match=why):
        roster.join("b", request(**wanted))
    assert state(roster) == before
    assert roster.counts() == {"refused_join": 1}


def test_the_right_agents_and_the_right_scenario_are_let_in(roster: Made) -> None:
    agents = {"flock": AGENTS["flock"]}  # of groups that it does not play, nothing is asked
    assert rows(asked(roster, "a", names=["flock-4"], agents=agents, scenario_sha256="d" * 64)) == {"flock": [4]}


def test_there_are_no_more_runners_than_the_limit(kind: str) -> None:
    roster = made(kind, policy=JoinPolicy(OFFER, open=True, limits=JoinLimits(runners=2)))
    asked(roster, "a", robots=1)
    asked(roster, "b", robots=1)
    with pytest.raises(JoinRefused, match="there are 2 runners already"):
        roster.join("c", request(robots=1))


def test_before_the_first_tick_who_leaves_or_is_lost_only_frees_its_robots(kind: str) -> None:
    roster = made(kind, "stop")
    asked(roster, "a", robots=3)
    ready(roster, "a")
    asked(roster, "b", robots=5)
    roster.answer("a", LEAVE)
    roster.lose("b", "its link is gone")
    assert roster.robots_free == 8
    assert [(change.what, change.runner, change.tick) for change in roster.events] == [
        ("joined", "a", -1),
        ("left", "a", -1),
        ("lost", "b", -1),
    ]
    assert roster.events[1].reason == ""
    asked(roster, "c", robots=8)
    roster.answer("c", LEAVE)
    assert (roster.events[-1].what, roster.events[-1].reason) == ("left", NOT_READY)
    assert rows(asked(roster, "b", robots=8)) == {"flock": FLOCK, "scouts": SCOUTS, "lone": [3, 7]}
    ready(roster, "b")
    assert str(roster.events[-1]) == (
        "b returned to flock-0, flock-1, flock-4, flock-5, scouts-2, scouts-6, lone-3, lone-7 (8 robots)"
        " before the first tick"
    )
    assert roster.counts() == {"runners_left": 2, "runners_lost": 1, "runners_returned": 1}


def test_who_tells_nothing_of_its_agents_is_counted_as_foreign_while_it_plays(kind: str) -> None:
    roster = made(kind, policy=JoinPolicy(OFFER, open=True))
    asked(roster, "own", robots=2, agents=AGENTS)
    asked(roster, "foreign", robots=2)
    assert roster.health().foreign == 0
    ready(roster, "own", "foreign")
    assert roster.health().foreign == 1
    roster.answer("foreign", LEAVE)
    assert roster.health().foreign == 0
    closed = made(kind, policy=JoinPolicy(OFFER))
    asked(closed, "r0")
    ready(closed, "r0")
    assert closed.health().foreign == 0


def test_robots_that_nobody_plays_are_told_in_their_order_whoever_came_and_went(roster: Made) -> None:
    every = roster.missing_robots
    asked(roster, "a", robots=3)
    roster.lose("a", "its link is gone")
    assert roster.missing_robots == every


def test_a_run_may_begin_with_some_robots(kind: str) -> None:
    roster = made(kind, policy=JoinPolicy(OFFER, open=True, start_with=3))
    assert roster.waiting
    asked(roster, "a", robots=2)
    ready(roster, "a")
    assert roster.waiting
    asked(roster, "b", robots=2)
    assert roster.waiting
    ready(roster, "b")
    assert not roster.waiting
    assert (roster.robots_played, roster.robots_free) == (4, 4)
    assert roster.health().robots_free == 4


def test_who_leaves_ends_a_run_that_bears_no_loss_but_fails_nobody(kind: str) -> None:
    roster = made(kind, "stop")
    asked(roster, "a")
    ready(roster, "a")
    roster._tick = 0
    with pytest.raises(Interrupted, match=r"runner a left, which played flock-0, .* lone-7 \(8 robots\)"):
        roster.answer("a", LEAVE)
    with pytest.raises(RunnerLost):
        roster.lose("a", "its link is gone")


@pytest.mark.parametrize("on_loss", ["dead", "wait", "stand", "coast"])
def test_who_leaves_a_run_that_bears_it_frees_its_robots_or_they_are_given_up(kind: str, on_loss: Any) -> None:
    roster = made(kind, on_loss)
    for runner, robots in (("a", 3), ("b", 5)):
        asked(roster, runner, robots=robots)
        ready(roster, runner)
    roster._tick = 7
    roster.answer("a", LEAVE)
    assert roster.events[-1] == RunnerEvent("left", "a", ("flock-0", "flock-1", "scouts-2"), 7)
    assert roster.counts() == {"runners_left": 1}
    assert not roster.losses
    if on_loss == "dead":
        with pytest.raises(JoinRefused, match="given up: flock-0"):
            roster.join("c", request(names=["flock-0"]))
    else:
        assert rows(asked(roster, "c")) == {"flock": [0, 1], "scouts": [2]}
        ready(roster, "c")
        assert roster.events[-1] == RunnerEvent("joined", "c", ("flock-0", "flock-1", "scouts-2"), 7)
        assert roster.counts() == {"runners_left": 1, "runners_joined_late": 1}


def test_an_offer_comes_over_whole(roster: Made) -> None:
    session_info = roster.session_info()
    assert session_info is not None
    assert SessionInfo.decode(session_info.encode()) == session_info
    assert free(roster)["flock"] == tuple(f"flock-{row}" for row in FLOCK)


def test_the_owner_of_each_robot_follows_the_cuts(roster: Made) -> None:
    asked(roster, "a", names=["flock-4", "lone-3"])
    asked(roster, "b", robots=2)
    players = np.array([slot.runner or "" for slot in roster._allocations])
    assert players[roster._allocations.owner].tolist() == ["b", "b", "", "a", "a", "", "", ""]


@pytest.mark.parametrize("asked", [{"names": ["\x1b[2J\n"]}, {"names": ["x" * 10**5]}, {"version": "\x1b" * 10**5}])
def test_what_a_runner_asks_for_reaches_terminals_short_and_harmless(asked: Any) -> None:
    with pytest.raises(JoinRefused) as refused:
        made("lockstep").join("a", request(**asked))
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) <= 500


def test_so_does_what_it_says_of_its_failure() -> None:
    roster = made("lockstep", "stop", JoinPolicy(OFFER))
    roster.join("a", request())
    said = {"robots": "\x1b[2J" + "x" * 1000, "traceback": "at line 1:\n\tboom\x1b[2J" + "x" * 10**6}
    with pytest.raises(AgentFailed) as failed:
        roster.answer("a", frames.encode("failed", -1, {}, said))
    assert failed.value.robots.isprintable()
    assert failed.value.traceback.startswith("at line 1:\n\tboom\\x1b[2Jx")
    assert len(str(failed.value)) < 200_000


def calls_of_joining(robots: int, wanted: dict[str, Any]) -> int:
    """How many functions, of Python's and of C's, the first to join calls: work that no other process changes."""
    roster, called = Lockstep([assignment(group("unused:Agent", [row])) for row in range(robots)]), 0

    def count(_frame: object, event: str, _argument: object) -> None:
        nonlocal called
        called += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        roster.join("r", request(**wanted))
    finally:
        sys.setprofile(before)
    return called


@pytest.mark.parametrize("wanted", [{}, {"names": ["flock-0"]}])
def test_one_of_many_runners_joins_with_about_the_work_of_one_of_few(wanted: dict[str, Any]) -> None:
    calls_of_joining(20, wanted)  # the first may import modules
    assert calls_of_joining(400, wanted) < 5 * calls_of_joining(20, wanted)
