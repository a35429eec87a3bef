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
from tests.support.world.locksteps import (
    FLOCK,
    assert_join_refused,
    joined,
    lockstep_of_two,
    ready,
    real_time_of_two,
    request,
    state,
)

Roster = Lockstep | RealTime
STATES, EVERY_MOVE = get_args(AllocationState), get_args(Move)
PAIRS = [(state, move) for state in STATES for move in EVERY_MOVE]
FLOOD = 5000


@pytest.fixture(params=[lockstep_of_two, real_time_of_two], ids=["lockstep", "real time"])
def roster(request: pytest.FixtureRequest) -> Roster:
    return request.param()


def test_runners_get_robots_in_the_order_in_which_they_join(roster: Roster) -> None:
    got = Assignment.from_mapping(msgpack.unpackb(roster.join("second-named-first", request())))
    assert got.robots_text == "flock-0, flock-1, scouts-2, lone-3 (4 robots)"
    assert got.groups[0].keys.tolist() == group("", FLOCK).keys[:2].tolist()
    assert Assignment.from_mapping(msgpack.unpackb(roster.join("a", request()))).groups[0].rows.tolist() == [4, 5]
    assert not roster.counts()


def test_assignment_round_trips() -> None:
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
    ("changed", "key"),
    [
        *(({"rows": rows}, "assignment.groups[0].rows[0]") for rows in ([1.0, 4], [True, 4], [-1, 4], [2**63, 4])),
        ({"rows": []}, "assignment.groups[0].rows"),
        ({"rows": [4, 4]}, "rows: expected robots by rising numbers"),
        ({"rows": [4]}, "expected one for each of the rows"),
        ({"keys": [1]}, "expected one for each of the rows"),
        ({"keys": [1, 2**64]}, "too large"),
        ({"keys": [1, -1]}, "assignment.groups[0].keys[1]"),
        ({"params": {1: 2}}, "expected `str`, got `int`"),
        ({"body": {}}, "assignment: "),
        *(({"act_every_ticks": ticks}, "assignment.groups[0].act_every_ticks") for ticks in (0, 2**31)),
    ],
    ids=str,
)
def test_malformed_assignment_is_refused_with_its_key(changed: dict[str, Any], key: str) -> None:
    mapping = assignment(group("a.b:C", [1, 4])).as_mapping()
    mapping["groups"][0] |= changed
    with pytest.raises(BadFrame, match=re.escape(key)) as caught:
        Assignment.from_mapping(mapping)
    assert caught.value.fault == "malformed"


@pytest.mark.parametrize(
    "name", ["", "a/b", "*", "**", "a*", "$*", "a?b", "a#b", "ä", "a b", "a\n", "x" * 65], ids=repr
)
def test_bad_runner_name_is_refused_and_counted(roster: Roster, name: str) -> None:
    assert_join_refused(joined(roster, "a"), name, request(), "expected a name", "bad_join")


@pytest.mark.parametrize(
    ("payload", "match"),
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
def test_bad_join_request_is_refused_and_counted(roster: Roster, payload: bytes, match: str) -> None:
    assert_join_refused(joined(roster, "a"), "b", payload, match, "bad_join")


def test_runner_name_in_use_is_refused(roster: Roster) -> None:
    assert_join_refused(joined(roster, "a"), "a", request(), "in use", "refused_join")


def test_join_after_all_robots_are_taken_is_refused(roster: Roster) -> None:
    assert_join_refused(joined(roster, "a", "b"), "c", request(), "all robots are taken", "refused_join")


def test_first_tick_waits_until_all_runners_are_ready(roster: Roster) -> None:
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
def test_ready_frame_is_expected_once_before_the_first_tick(roster: Roster, kind: str) -> None:
    joined(roster, "a", "b")
    if kind == "ready":
        ready(roster, "a")
    before = state(roster)
    roster.answer("a", frames.encode(kind, -1, {}))
    assert state(roster) == before
    assert roster.counts() == {{"ready": "unexpected_kind_frames", "actions": "wrong_tick_frames"}[kind]: 1}


@pytest.mark.parametrize("payload", [b"\xc1", msgpack.packb(3), request(frames.VERSION + 1)])
def test_session_info_is_refused_in_another_version(roster: Roster, payload: bytes) -> None:
    with pytest.raises(JoinRefused):
        roster.session_info(payload)
    assert roster.counts() == {"bad_join": 1}


def test_session_info_is_none_without_an_offer(roster: Roster) -> None:
    assert roster.session_info() is None


def test_runner_is_building_between_join_and_ready(roster: Roster) -> None:
    assert not roster.is_building("a")
    joined(roster, "a")
    assert roster.is_building("a")
    ready(roster, "b")
    assert not roster.is_building("b")


def slot(state: AllocationState) -> Allocation:
    robots = assignment(group("unused:Agent", [0]))
    return Allocation(robots, robots.groups[0].rows, "somebody", state)


@pytest.mark.parametrize(("state", "move"), PAIRS)
def test_allocation_accepts_only_the_moves_of_its_table(state, move) -> None:
    allocation = slot(state)
    before = vars(allocation).copy()
    if move in MOVES[state]:
        allocation.move(move)
        assert vars(allocation) == before | {"state": MOVES[state][move]}
    else:
        with pytest.raises(RuntimeError, match=f"{state} has no move '{move}'"):
            allocation.move(move)
        assert vars(allocation) == before


@pytest.fixture
def session(tmp_path) -> Generator[zenoh.Session]:
    with closed_after(open_world(unix_endpoint(f"{tmp_path}/w"), 10.0)) as session:
        yield session


def inbox_after(session: zenoh.Session, limits: JoinLimits, *puts: tuple[str, bytes]) -> RunnerInbox:
    """An inbox after these puts, in their order."""
    inbox, received = RunnerInbox(limits), list[zenoh.Sample]()
    subscriber = session.declare_subscriber("answer/*", received.append)
    for runner, payload in puts:
        session.put(f"answer/{runner}", payload, congestion_control=zenoh.CongestionControl.BLOCK)
    until(lambda: len(received) == len(puts))
    subscriber.undeclare()
    for sample in received:
        inbox.put(sample)
    return inbox


def drain(inbox: RunnerInbox) -> list[tuple[str, bytes]]:
    items = [inbox.get() for _ in range(inbox.qsize())]
    return [(str(item.key_expr), item.payload.to_bytes()) for item in items if isinstance(item, zenoh.Sample)]


def test_inbox_flood_of_one_runner_does_not_block_another(session):
    puts = [("b", b"first"), *[("a", b"x")] * FLOOD, ("b", b"last")]
    inbox = inbox_after(session, JoinLimits(waiting=3), *puts)
    assert drain(inbox) == [("answer/b", b"first"), *[("answer/a", b"x")] * 3, ("answer/b", b"last")]
    assert inbox.counts() == {"flooded_frames": FLOOD - 3}


def test_inbox_names_the_runner_that_floods(session):
    inbox = inbox_after(session, JoinLimits(waiting=1, flood=2), *[("a", b"x")] * 4, *[("b", b"x")] * 3)
    assert inbox.rate_limited() == {"a"}


def test_inbox_has_room_again_after_a_get(session):
    inbox = inbox_after(session, JoinLimits(waiting=2), *[("a", b"x")] * 2)
    item = inbox.get()
    inbox.put(item)
    assert inbox.qsize() == 2
    assert inbox.counts() == {}


def test_inbox_limits_bytes_but_accepts_one_frame_of_any_size(session):
    inbox = inbox_after(
        session, JoinLimits(waiting_bytes=10), ("a", b"x" * 11), ("a", b"x"), ("b", b"x" * 10), ("b", b"x")
    )
    assert [len(payload) for _, payload in drain(inbox)] == [11, 10]
    assert inbox.counts() == {"flooded_frames": 2}


def inbox_after_requests(session: zenoh.Session, limits: JoinLimits, *runners: str) -> RunnerInbox:
    """An inbox after a request of each runner in turn; the requests that it accepts are answered."""
    inbox = RunnerInbox(limits)
    queryable = session.declare_queryable("join/*", zenoh.handlers.Callback(inbox.put, indirect=False))
    for runner in runners:
        replies = session.get(f"join/{runner}", timeout=10.0)
        if inbox.qsize():
            query = inbox.get(timeout=10.0)
            assert isinstance(query, zenoh.Query)
            with query:
                query.reply(query.key_expr, b"yes")
        list(replies)
    queryable.undeclare()
    return inbox


def test_inbox_limits_requests_of_one_runner_over_the_run(session):
    inbox = inbox_after_requests(session, JoinLimits(requests=2), *("a", "a", "b") * 2)
    assert inbox.counts() == {"flooded_requests": 2}


def test_inbox_remembers_a_limited_number_of_names(session):
    inbox = inbox_after_requests(session, JoinLimits(names=2), "a", "b", "c", "d", "a")
    assert inbox.counts() == {"flooded_requests": 2}
    assert len(inbox._requests) == len(inbox._dropped_by_runner) == 2


def test_inbox_get_raises_empty_after_its_timeout():
    with pytest.raises(queue.Empty):
        RunnerInbox().get(timeout=0.0)
