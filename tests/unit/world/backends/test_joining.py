"""Runners that join: handshakes, allocations, and the inbox."""

import queue
import re
from collections.abc import Generator
from typing import Any, get_args

import msgpack
import numpy as np
import pytest
import zenoh

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.assignment import Assignment
from swarmwire.comms.wire.join import MAX_JOIN_BYTES
from swarmwire.comms.wire.limits import JoinLimits
from swarmwire.comms.wire.sessions import closed_after, open_world, unix_endpoint
from swarmwire.world.backends.allocation import MOVES, Allocation, AllocationState, Move
from swarmwire.world.backends.inbox import RunnerInbox
from swarmwire.world.backends.join_policy import JoinRefused
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.realtime import RealTime
from tests.support.agent.hosts import MEASURES, assignment, group
from tests.support.clocks import until
from tests.support.world.locksteps import FLOCK, joined, ready, request, state, two, two_in_real_time

Made = Lockstep | RealTime
STATES, EVERY_MOVE = get_args(AllocationState), get_args(Move)
PAIRS = [(state, move) for state in STATES for move in EVERY_MOVE]
FLOOD = 5000


@pytest.fixture(params=[two, two_in_real_time], ids=["lockstep", "real time"])
def roster(request: pytest.FixtureRequest) -> Made:
    return request.param()


def test_runners_get_robots_in_the_order_in_which_they_join(roster: Made) -> None:
    got = Assignment.from_mapping(msgpack.unpackb(roster.join("second-named-first", request())))
    assert got.robots_text == "flock-0, flock-1, scouts-2, lone-3 (4 robots)"
    assert got.groups[0].keys.tolist() == group("", FLOCK).keys[:2].tolist()
    assert Assignment.from_mapping(msgpack.unpackb(roster.join("a", request()))).groups[0].rows.tolist() == [4, 5]
    assert not roster.counts()


def test_an_assignment_comes_over_whole() -> None:
    sent = assignment(
        group("a.b:C", [1, 4], params={"x": 1.5, "n": 2, "on": True, "w": "ä"}), group("d:E", [2], "s", "footbot")
    )
    got = Assignment.from_mapping(msgpack.unpackb(msgpack.packb(sent.as_mapping())))
    assert got.as_mapping() == sent.as_mapping()
    assert got.measures == MEASURES
    assert got.groups[1].body == sent.groups[1].body
    assert got.groups[0].keys.dtype == np.uint64
    assert Assignment.from_mapping(Assignment((), 10, None).as_mapping()).measures is None


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"rows": [1.0, 4]}, "assignment.groups[0].rows[0]: expected `int`, got `float`"),
        ({"rows": [True, 4]}, "assignment.groups[0].rows[0]: expected `int`, got `bool`"),
        ({"rows": [-1, 4]}, "assignment.groups[0].rows[0]: expected `int` >= 0"),
        ({"rows": [2**63, 4]}, "assignment.groups[0].rows[0]: expected `int` <= 9223372036854775807"),
        ({"rows": []}, "assignment.groups[0].rows: expected `array` of length >= 1"),
        ({"rows": [4, 4]}, "rows: expected robots by rising numbers"),
        ({"rows": [4]}, "expected one for each of the rows"),
        ({"keys": [1]}, "expected one for each of the rows"),
        ({"keys": [1, 2**64]}, "too large"),
        ({"keys": [1, -1]}, "assignment.groups[0].keys[1]: expected `int` >= 0"),
        ({"params": {1: 2}}, "expected `str`, got `int`"),
        ({"body": {}}, "assignment: "),
        ({"act_every_ticks": 0}, "assignment.groups[0].act_every_ticks: expected `int` >= 1"),
        ({"act_every_ticks": 2**31}, "assignment.groups[0].act_every_ticks: expected `int`"),
    ],
    ids=str,
)
def test_what_is_no_assignment_is_refused(changed: dict[str, Any], fault: str) -> None:
    mapping = assignment(group("a.b:C", [1, 4])).as_mapping()
    mapping["groups"][0] |= changed
    with pytest.raises(BadFrame, match=re.escape(fault)) as caught:
        Assignment.from_mapping(mapping)
    assert caught.value.fault == "malformed"


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        *((data, "malformed") for data in (b"", b"\xc1", b"\x91" * 5000, msgpack.packb(None), msgpack.packb({1: 2}))),
        (bytes(MAX_JOIN_BYTES + 1), "oversized"),
        *((request(version), f"expected version {frames.VERSION}") for version in (0, frames.VERSION + 1, "1", None)),
        *((request(robots=robots), "request.robots: expected `int") for robots in (0, -1, 1.5, "3", True)),
        *((request(names=names), "request.names") for names in ("flock-0", [1], {})),
        (request(robots=1, names=["flock-0"]), "not both"),
        *((request(agents=agents), "request.agents") for agents in ([], {"flock": "beef"}, {"flock": 3})),
        (request(scenario_sha256="0" * 63), "scenario_sha256: expected"),
    ],
    ids=repr,
)
def test_a_bad_request_is_refused_counted_and_changes_nothing(roster: Made, bad: bytes, why: str) -> None:
    joined(roster, "a")
    before = state(roster)
    with pytest.raises(JoinRefused, match=why):
        roster.join("b", bad)
    assert state(roster) == before
    assert roster.counts() == {"bad_join": 1}


@pytest.mark.parametrize(
    "name", ["", "a/b", "*", "**", "a*", "$*", "a?b", "a#b", "ä", "a b", "a\n", "x" * 65], ids=repr
)
def test_a_bad_name_is_refused_counted_and_changes_nothing(roster: Made, name: str) -> None:
    joined(roster, "a")
    before = state(roster)
    with pytest.raises(JoinRefused, match="expected a name"):
        roster.join(name, request())
    assert state(roster) == before
    assert roster.counts() == {"bad_join": 1}


def test_a_name_in_use_is_refused(roster: Made) -> None:
    joined(roster, "a")
    before = state(roster)
    with pytest.raises(JoinRefused, match="in use"):
        roster.join("a", request())
    assert state(roster) == before
    assert roster.counts() == {"refused_join": 1}


def test_who_comes_too_late_gets_no_robots(roster: Made) -> None:
    joined(roster, "a", "b")
    before = state(roster)
    with pytest.raises(JoinRefused, match="all robots are taken"):
        roster.join("c", request())
    assert state(roster) == before
    assert roster.counts() == {"refused_join": 1}


def test_the_first_tick_may_begin_once_all_are_ready(roster: Made) -> None:
    assert roster.waiting
    assert roster.missing == ("that did not join", "flock-0, flock-1, scouts-2, lone-3 (4 robots)")
    joined(roster, "a", "b")
    assert roster.missing[0] == "a"
    ready(roster, "a")
    assert roster.waiting
    assert roster.missing == ("b", "flock-4, flock-5, scouts-6, lone-7 (4 robots)")
    ready(roster, "b")
    assert not roster.waiting
    assert not roster.counts()


@pytest.mark.parametrize("kind", ["actions", "ready"])
def test_before_the_first_tick_only_a_first_ready_counts(roster: Made, kind: str) -> None:
    joined(roster, "a", "b")
    if kind == "ready":
        ready(roster, "a")
    before = state(roster)
    roster.answer("a", frames.encode(kind, -1, {}))
    assert state(roster) == before
    assert roster.counts() == {{"ready": "unexpected_kind_frames", "actions": "wrong_tick_frames"}[kind]: 1}


@pytest.mark.parametrize("asked", [b"\xc1", msgpack.packb(3), request(frames.VERSION + 1)])
def test_an_offer_is_not_told_to_who_asks_in_another_version(roster: Made, asked: bytes) -> None:
    with pytest.raises(JoinRefused):
        roster.session_info(asked)
    assert roster.counts() == {"bad_join": 1}


def test_where_there_is_nothing_to_offer_nothing_is_told(roster: Made) -> None:
    assert roster.session_info() is None


def test_a_runner_is_building_from_when_it_joined_until_it_is_ready(roster: Made) -> None:
    assert not roster.is_building("a")
    joined(roster, "a")
    assert roster.is_building("a")
    ready(roster, "b")
    assert not roster.is_building("b")


def slot(state: AllocationState) -> Allocation:
    its = assignment(group("unused:Agent", [0]))
    return Allocation(its, its.groups[0].rows, "somebody", state)


@pytest.mark.parametrize(("state", "move"), PAIRS)
def test_a_move_of_the_table_leads_where_it_says_and_any_other_raises_and_changes_nothing(state, move) -> None:
    it = slot(state)
    before = vars(it).copy()
    if move in MOVES[state]:
        it.move(move)
        assert vars(it) == before | {"state": MOVES[state][move]}
    else:
        with pytest.raises(RuntimeError, match=f"{state} has no move '{move}'"):
            it.move(move)
        assert vars(it) == before


def test_every_state_stands_in_the_table_and_can_be_reached() -> None:
    assert set(MOVES) == set(STATES)
    reached = set(STATES[:1])
    while more := {to for state in reached for to in MOVES[state].values()} - reached:
        reached |= more
    assert reached == set(STATES)
    assert {move for moves in MOVES.values() for move in moves} == set(EVERY_MOVE)


@pytest.fixture
def session(tmp_path) -> Generator[zenoh.Session]:
    with closed_after(open_world(unix_endpoint(f"{tmp_path}/w"), 10.0)) as session:
        yield session


def filled(session: zenoh.Session, limits: JoinLimits, *puts: tuple[str, bytes]) -> RunnerInbox:
    """An inbox that was told all of this, in this order."""
    inbox, received = RunnerInbox(limits), list[zenoh.Sample]()
    subscriber = session.declare_subscriber("answer/*", received.append)
    for runner, payload in puts:
        session.put(f"answer/{runner}", payload, congestion_control=zenoh.CongestionControl.BLOCK)
    until(lambda: len(received) == len(puts))
    subscriber.undeclare()
    for sample in received:
        inbox.put(sample)
    return inbox


def taken(inbox: RunnerInbox) -> list[tuple[str, bytes]]:
    items = [inbox.get() for _ in range(inbox.qsize())]
    return [(str(item.key_expr), item.payload.to_bytes()) for item in items if isinstance(item, zenoh.Sample)]


def test_a_flood_of_one_runner_keeps_no_other_out(session):
    puts = [("b", b"first"), *[("a", b"x")] * FLOOD, ("b", b"last")]
    inbox = filled(session, JoinLimits(waiting=3), *puts)
    assert taken(inbox) == [("answer/b", b"first"), *[("answer/a", b"x")] * 3, ("answer/b", b"last")]
    assert inbox.counts() == {"flooded_frames": FLOOD - 3}


def test_who_floods_is_known_by_name(session):
    inbox = filled(session, JoinLimits(waiting=1, flood=2), *[("a", b"x")] * 4, *[("b", b"x")] * 3)
    assert inbox.rate_limited() == {"a"}


def test_what_was_taken_makes_room(session):
    inbox = filled(session, JoinLimits(waiting=2), *[("a", b"x")] * 2)
    item = inbox.get()
    inbox.put(item)
    assert inbox.qsize() == 2
    assert inbox.counts() == {}


def test_few_that_are_large_are_bounded_too_and_one_is_always_taken(session):
    inbox = filled(session, JoinLimits(waiting_bytes=10), ("a", b"x" * 11), ("a", b"x"), ("b", b"x" * 10), ("b", b"x"))
    assert [len(payload) for _, payload in taken(inbox)] == [11, 10]
    assert inbox.counts() == {"flooded_frames": 2}


def asked_by(session: zenoh.Session, limits: JoinLimits, *runners: str) -> RunnerInbox:
    """An inbox that each of them asked in turn, and that answered those that it let in."""
    inbox = RunnerInbox(limits)
    asked = session.declare_queryable("join/*", zenoh.handlers.Callback(inbox.put, indirect=False))
    for runner in runners:
        replies = session.get(f"join/{runner}", timeout=10.0)
        if inbox.qsize():
            query = inbox.get(timeout=10.0)
            assert isinstance(query, zenoh.Query)
            with query:
                query.reply(query.key_expr, b"yes")
        list(replies)
    asked.undeclare()
    return inbox


def test_requests_of_one_runner_are_counted_over_the_whole_run(session):
    inbox = asked_by(session, JoinLimits(requests=2), *("a", "a", "b") * 2)
    assert inbox.counts() == {"flooded_requests": 2}


def test_who_asks_under_ever_new_names_is_remembered_so_often_and_no_more(session):
    inbox = asked_by(session, JoinLimits(names=2), "a", "b", "c", "d", "a")
    assert inbox.counts() == {"flooded_requests": 2}
    assert len(inbox._requests) == len(inbox._dropped_by_runner) == 2


def test_nothing_in_time_is_an_empty_queue():
    with pytest.raises(queue.Empty):
        RunnerInbox().get(timeout=0.0)
