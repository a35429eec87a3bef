"""An inbox holds so much of each runner, whatever that sends, and counts the rest."""

import queue
from collections.abc import Generator

import pytest
import zenoh

from swarmwire.comms.wire.join import JoinLimits
from swarmwire.comms.wire.sessions import closed_after, open_world, unix_endpoint
from swarmwire.world.backends.inbox import RunnerInbox
from tests.support.waiting import until

FLOOD = 5000


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
    assert len(inbox._requests) == len(inbox._dropped_of) == 2


def test_nothing_in_time_is_an_empty_queue():
    with pytest.raises(queue.Empty):
        RunnerInbox().get(timeout=0.0)
