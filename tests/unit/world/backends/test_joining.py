"""Runners that join: handshakes, allocations, and the inbox."""

import re
from collections.abc import Generator
from typing import Any, get_args

import msgpack
import numpy as np
import pytest
import zenoh

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
from tests.support.refusals import refused_frame
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
    with refused_frame("malformed", re.escape(key)):
        Assignment.from_mapping(mapping)


@pytest.mark.parametrize(("changed", "key"), [({"rows": [2, 3]}, "groups: "), ({"name": "other"}, "rows: ")])
def test_assignment_with_a_group_or_a_robot_twice_is_refused(changed: dict[str, Any], key: str) -> None:
    mapping = assignment(group("a.b:C", [1, 4])).as_mapping()
    mapping["groups"].append(mapping["groups"][0] | changed)
    with refused_frame("malformed", re.escape(key)):
        Assignment.from_mapping(mapping)


BAD_NAMES = ("", "a/b", "*", "**", "a*", "$*", "a?b", "a#b", "ä", "a b", "a\n", "x" * 65)


@pytest.mark.parametrize(
    ("players", "name", "payload", "match", "count"),
    [
        *(("a", name, request(), "expected a name", "bad_join") for name in BAD_NAMES),
        # tests/unit/comms/wire/test_join.py has more requests.
        *(("a", "b", data, "malformed", "bad_join") for data in (b"", msgpack.packb(None), request(robots=0))),
        ("a", "b", bytes(MAX_JOIN_BYTES + 1), "oversized", "bad_join"),
        ("a", "b", request(frames.VERSION + 1), f"expected version {frames.VERSION}", "bad_join"),
        ("a", "a", request(), "in use", "refused_join"),
        ("ab", "c", request(), "all robots are taken", "refused_join"),
    ],
    ids=repr,
)
def test_join_is_refused_and_counted(roster: Roster, players: str, name: str, payload: bytes, match: str, count: str):
    assert_join_refused(joined(roster, *players), name, payload, match, count)


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


def test_session_info_is_none_without_an_offer_and_refused_in_another_version(roster: Roster) -> None:
    assert roster.session_info() is None
    with pytest.raises(JoinRefused):
        roster.session_info(request(frames.VERSION + 1))
    assert roster.counts() == {"bad_join": 1}


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


@pytest.mark.parametrize(
    ("limits", "puts", "accepted"),
    [
        (JoinLimits(waiting=3), [("b", b"first"), *[("a", b"x")] * FLOOD, ("b", b"last")], [0, 1, 2, 3, -1]),
        # One frame of any size is accepted.
        (JoinLimits(waiting_bytes=10), [("a", b"x" * 11), ("a", b"x"), ("b", b"x" * 10), ("b", b"x")], [0, 2]),
    ],
    ids=["frames", "bytes"],
)
def test_inbox_flood_of_one_runner_does_not_block_another(session, limits, puts, accepted: list[int]):
    inbox = inbox_after(session, limits, *puts)
    assert drain(inbox) == [(f"answer/{puts[k][0]}", puts[k][1]) for k in accepted]
    assert inbox.counts() == {"flooded_frames": len(puts) - len(accepted)}


def test_inbox_names_the_runner_that_floods(session):
    inbox = inbox_after(session, JoinLimits(waiting=1, flood=2), *[("a", b"x")] * 4, *[("b", b"x")] * 3)
    assert inbox.rate_limited() == {"a"}


def test_inbox_has_room_again_after_a_get(session):
    inbox = inbox_after(session, JoinLimits(waiting=2), *[("a", b"x")] * 2)
    item = inbox.get()
    inbox.put(item)
    assert inbox.qsize() == 2
    assert inbox.counts() == {}


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
