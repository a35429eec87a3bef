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
from tests.support.world.locksteps import FLOCK, SCOUTS, assert_join_refused, parts, ready, request

Roster = Lockstep | RealTime
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


def one_part() -> list[Assignment]:
    return parts(dict.fromkeys(range(8), 0))


def roster_of(kind: str, on_loss: OnLoss = "stand", policy: JoinPolicy = OPEN) -> Roster:
    if kind == "lockstep":
        return Lockstep(one_part(), on_loss, policy)
    return RealTime(one_part(), 0.5, 30.0, on_loss, policy)


@pytest.fixture(params=["lockstep", "real time"])
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def roster(kind: str) -> Roster:
    return roster_of(kind)


def assigned(roster: Roster, runner: str, **requested: Any) -> Assignment:
    return Assignment.from_mapping(msgpack.unpackb(roster.join(runner, request(**requested))))


def rows(assignment: Assignment) -> dict[str, list[int]]:
    return {group.name: group.rows.tolist() for group in assignment.groups}


def free(roster: Roster) -> dict[str, tuple[str, ...]]:
    session_info = roster.session_info()
    assert session_info is not None
    return {group.name: group.free for group in session_info.groups if group.free}


def test_number_of_robots_gets_the_next_free_ones(roster: Roster) -> None:
    assert rows(assigned(roster, "a", robots=3)) == {"flock": [0, 1], "scouts": [2]}
    assert rows(assigned(roster, "b", robots=1)) == {"lone": [3]}
    assert free(roster) == {"flock": ("flock-4", "flock-5"), "scouts": ("scouts-6",), "lone": ("lone-7",)}
    assert rows(assigned(roster, "c", robots=4)) == {"flock": [4, 5], "scouts": [6], "lone": [7]}
    assert free(roster) == {}
    assert not roster.counts()


def test_robot_names_are_assigned_and_no_names_mean_the_remaining(roster: Roster) -> None:
    got = assigned(roster, "a", names=["lone-7", "flock-1"])
    assert rows(got) == {"flock": [1], "lone": [7]}
    assert [group.robot_names for group in got.groups] == [("flock-1",), ("lone-7",)]
    assert rows(assigned(roster, "b")) == {"flock": [0, 4, 5], "scouts": SCOUTS, "lone": [3]}


def test_missing_robots_of_several_lost_processes_go_to_the_next_runner(kind: str) -> None:
    roster = roster_of(kind, "wait")
    assigned(roster, "a")
    ready(roster, "a")
    for row in (1, 7):
        process = {"process": str(row), "reason": "killed"}
        roster.answer("a", frames.encode("lost", -1, {"rows": np.array([row])}, process))
    with pytest.raises(JoinRefused, match=r"the name a is in use, .*flock-0, flock-4, .*: join under another name"):
        assigned(roster, "a")
    assert rows(assigned(roster, "b")) == {"flock": [1], "lone": [7]}


def test_cut_assignment_keeps_parameters_and_keys_of_its_robots() -> None:
    assignment = parts(dict.fromkeys(range(8), 0))
    flock = assignment[0].groups[0]
    flock.params["lane"] = [10, 11, 14, 15]
    lockstep = Lockstep(assignment, "stand", OPEN)
    got = assigned(lockstep, "a", names=["flock-4", "flock-1"]).groups[0]
    assert got.params == {"lane": [11, 14]}
    assert got.keys.tolist() == flock.keys[[1, 2]].tolist()
    for name in ("flock-0", "flock-5"):  # makes two parts after they left
        assigned(lockstep, name, names=[name])
    for runner in ("flock-5", "a"):
        lockstep.answer(runner, LEAVE)
    again = assigned(lockstep, "b", names=["flock-1", "flock-5"]).groups[0]
    assert (again.rows.tolist(), again.params) == ([1, 5], {"lane": [11, 15]})
    assert again.keys.tolist() == flock.keys[[1, 3]].tolist()


@pytest.mark.parametrize(
    ("requested", "why"),
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
def test_impossible_request_is_refused_and_counted(kind: str, requested: dict[str, Any], why: str) -> None:
    roster = roster_of(kind, policy=JoinPolicy(OFFER, open=True, limits=JoinLimits(robots_per_runner=4)))
    assigned(roster, "a", robots=3)
    assert_join_refused(roster, "b", request(**requested), why, "refused_join")


def test_request_with_matching_agents_and_scenario_is_accepted(roster: Roster) -> None:
    agents = {"flock": AGENTS["flock"]}  # the other groups' agents do not count
    assert rows(assigned(roster, "a", names=["flock-4"], agents=agents, scenario_sha256="d" * 64)) == {"flock": [4]}


def test_join_beyond_the_limit_of_runners_is_refused(kind: str) -> None:
    roster = roster_of(kind, policy=JoinPolicy(OFFER, open=True, limits=JoinLimits(runners=2)))
    assigned(roster, "a", robots=1)
    assigned(roster, "b", robots=1)
    with pytest.raises(JoinRefused, match="there are 2 runners already"):
        roster.join("c", request(robots=1))


def test_leaving_before_the_first_tick_frees_the_robots(kind: str) -> None:
    roster = roster_of(kind, "stop")
    assigned(roster, "a", robots=3)
    ready(roster, "a")
    assigned(roster, "b", robots=5)
    roster.answer("a", LEAVE)
    roster.lose("b", "its link is gone")
    assert roster.robots_free == 8
    assert [(change.what, change.runner, change.tick) for change in roster.events] == [
        ("joined", "a", -1),
        ("left", "a", -1),
        ("lost", "b", -1),
    ]
    assert roster.events[1].reason == ""
    assigned(roster, "c", robots=8)
    roster.answer("c", LEAVE)
    assert (roster.events[-1].what, roster.events[-1].reason) == ("left", NOT_READY)
    assert rows(assigned(roster, "b", robots=8)) == {"flock": FLOCK, "scouts": SCOUTS, "lone": [3, 7]}
    ready(roster, "b")
    assert str(roster.events[-1]) == (
        "b returned to flock-0, flock-1, flock-4, flock-5, scouts-2, scouts-6, lone-3, lone-7 (8 robots)"
        " before the first tick"
    )
    assert roster.counts() == {"runners_left": 2, "runners_lost": 1, "runners_returned": 1}


def test_runner_without_agent_hashes_counts_as_foreign(kind: str) -> None:
    roster = roster_of(kind, policy=JoinPolicy(OFFER, open=True))
    assigned(roster, "own", robots=2, agents=AGENTS)
    assigned(roster, "foreign", robots=2)
    assert roster.health().foreign == 0
    ready(roster, "own", "foreign")
    assert roster.health().foreign == 1
    roster.answer("foreign", LEAVE)
    assert roster.health().foreign == 0
    closed = roster_of(kind, policy=JoinPolicy(OFFER))
    assigned(closed, "r0")
    ready(closed, "r0")
    assert closed.health().foreign == 0


def test_missing_robots_keep_their_order_after_a_loss(roster: Roster) -> None:
    every = roster.missing_robots
    assigned(roster, "a", robots=3)
    roster.lose("a", "its link is gone")
    assert roster.missing_robots == every


def test_run_starts_with_start_with_robots(kind: str) -> None:
    roster = roster_of(kind, policy=JoinPolicy(OFFER, open=True, start_with=3))
    assert roster.waiting
    assigned(roster, "a", robots=2)
    ready(roster, "a")
    assert roster.waiting
    assigned(roster, "b", robots=2)
    assert roster.waiting
    ready(roster, "b")
    assert not roster.waiting
    assert (roster.robots_played, roster.robots_free) == (4, 4)
    assert roster.health().robots_free == 4


def test_leaving_ends_a_run_that_tolerates_no_loss(kind: str) -> None:
    roster = roster_of(kind, "stop")
    assigned(roster, "a")
    ready(roster, "a")
    roster._tick = 0
    with pytest.raises(Interrupted, match=r"runner a left, which played flock-0, .* lone-7 \(8 robots\)"):
        roster.answer("a", LEAVE)
    with pytest.raises(RunnerLost):
        roster.lose("a", "its link is gone")


@pytest.mark.parametrize("on_loss", ["dead", "wait", "stand", "coast"])
def test_leaving_frees_robots_or_gives_them_up_when_dead(kind: str, on_loss: Any) -> None:
    roster = roster_of(kind, on_loss)
    for runner, robots in (("a", 3), ("b", 5)):
        assigned(roster, runner, robots=robots)
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
        assert rows(assigned(roster, "c")) == {"flock": [0, 1], "scouts": [2]}
        ready(roster, "c")
        assert roster.events[-1] == RunnerEvent("joined", "c", ("flock-0", "flock-1", "scouts-2"), 7)
        assert roster.counts() == {"runners_left": 1, "runners_joined_late": 1}


def test_session_info_round_trips_with_the_free_robots(roster: Roster) -> None:
    session_info = roster.session_info()
    assert session_info is not None
    assert SessionInfo.decode(session_info.encode()) == session_info
    assert free(roster)["flock"] == tuple(f"flock-{row}" for row in FLOCK)


@pytest.mark.parametrize("fields", [{"names": ["\x1b[2J\n"]}, {"names": ["x" * 10**5]}, {"version": "\x1b" * 10**5}])
def test_refusal_of_a_hostile_request_is_short_and_printable(fields: Any) -> None:
    with pytest.raises(JoinRefused) as caught:
        roster_of("lockstep").join("a", request(**fields))
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) <= 500


def test_failure_text_of_a_hostile_runner_is_bounded_and_escaped() -> None:
    roster = roster_of("lockstep", "stop", JoinPolicy(OFFER))
    roster.join("a", request())
    texts = {"robots": "\x1b[2J" + "x" * 1000, "traceback": "at line 1:\n\tboom\x1b[2J" + "x" * 10**6}
    with pytest.raises(AgentFailed) as failed:
        roster.answer("a", frames.encode("failed", -1, {}, texts))
    assert failed.value.robots.isprintable()
    assert failed.value.traceback.startswith("at line 1:\n\tboom\\x1b[2Jx")
    assert len(str(failed.value)) < 200_000


def calls_of_joining(robots: int, requested: dict[str, Any]) -> int:
    """Number of Python and C functions that the first join calls: its work, however busy the machine."""
    roster, called = Lockstep([assignment(group("unused:Agent", [row])) for row in range(robots)]), 0

    def count(_frame: object, event: str, _argument: object) -> None:
        nonlocal called
        called += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        roster.join("r", request(**requested))
    finally:
        sys.setprofile(before)
    return called


@pytest.mark.parametrize("requested", [{}, {"names": ["flock-0"]}])
def test_join_costs_about_equal_work_among_many_runners(requested: dict[str, Any]) -> None:
    calls_of_joining(20, requested)  # the first may import modules
    assert calls_of_joining(400, requested) < 5 * calls_of_joining(20, requested)
