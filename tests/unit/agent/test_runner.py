"""A runner's inbox: it acts on the newest frame only, and counts what it passes over."""

from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
import pytest
import zenoh

from swarmwire.agent import runner
from swarmwire.agent.runner import NEXT_FREE, TickInbox, assigned_robots
from swarmwire.comms.errors import BadFrame, RunnerLost
from swarmwire.comms.packets import BROADCAST, NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.tick_frames import encode_packets, encode_tick
from tests.support.agent.hosts import MEASURES, assignment, group, readings, received_from


@dataclass
class Bytes:
    data: bytes

    def to_bytes(self) -> bytes:
        return self.data


@dataclass
class Sample:
    payload: Bytes


def inbox_of(*arrived: Any) -> TickInbox:
    inbox = TickInbox()
    for item in arrived:
        inbox._arrived.put(item if isinstance(item, bool) else Sample(Bytes(item)))
    return inbox


def tick(number: int) -> bytes:
    return encode_tick(number, {"flock": readings(number, [0])}, ReceivedPackets.none(MEASURES), NO_TX_STATUSES)


ASSIGNMENT = assignment(group("unused:Agent", [0]))
END = frames.encode("end", -1, {})


def test_of_frames_that_wait_the_newest_is_acted_on_and_the_others_are_counted() -> None:
    inbox = inbox_of(True, tick(0), tick(1), tick(2))
    ticks = inbox.ticks(ASSIGNMENT)
    assert next(ticks)[0] == 2
    assert inbox.dropped == 2
    strange = encode_tick(9, {"others": readings(9, [1])}, ReceivedPackets.none(MEASURES), NO_TX_STATUSES)
    of_others = encode_tick(9, {"flock": readings(9, [1])}, ReceivedPackets.none(MEASURES), NO_TX_STATUSES)
    for data in (tick(2), tick(1), b"\xc1", strange, of_others, tick(3), tick(5), tick(4)):
        inbox.put_frame(Sample(Bytes(data)))
    assert next(ticks)[0] == 5
    assert inbox.dropped == 2 + 7
    inbox.put_frame(Sample(Bytes(tick(6))))
    assert next(ticks)[0] == 6
    assert inbox.dropped == 9


def test_nothing_is_acted_on_once_the_run_is_over() -> None:
    assert list(inbox_of(tick(0), END).ticks(ASSIGNMENT)) == []
    assert list(inbox_of(tick(0), tick(1), False).ticks(ASSIGNMENT)) == []


def packets(number: int, tick_number: int = 0) -> bytes:
    sent = SentPackets(np.array([1]), np.array([BROADCAST]), Payloads.of([bytes([0, 0, number])]))
    return encode_packets(tick_number, 1_000 * number, number, received_from(sent, [0]), NO_TX_STATUSES)


def test_packets_between_ticks_are_kept_at_once_and_told_of_when_nothing_newer_waits() -> None:
    inbox, kept = inbox_of(True, tick(0)), list[int]()

    def receive(received: ReceivedPackets, _: TxStatuses) -> None:
        kept.append(received.payloads.row(0)[2])

    told = inbox.ticks(ASSIGNMENT, receive)
    assert next(told)[0] == 0
    for data in (packets(0), packets(1)):
        inbox.put_frame(Sample(Bytes(data)))
    assert next(told) == (0, 1_000)
    assert kept == [0, 1]
    for data in (packets(2), tick(1), packets(3, 1)):
        inbox.put_frame(Sample(Bytes(data)))
    assert next(told)[0] == 1  # with the packets that are there: the step reads all of them
    assert kept == [0, 1, 2, 3]
    inbox.put_frame(Sample(Bytes(END)))
    assert list(told) == []
    assert (inbox.dropped, inbox.missed) == (0, 0)


def test_frames_with_packets_that_never_came_are_counted() -> None:
    inbox = inbox_of(True, packets(2), packets(3), packets(7), frames.encode("packets", 0, {}))
    assert next(inbox.ticks(ASSIGNMENT)) == (0, 7_000)
    assert (inbox.missed, inbox.dropped) == (2 + 3, 1)


def test_what_came_before_the_robots_were_given_is_forgotten_but_not_that_the_world_is_gone() -> None:
    inbox = inbox_of(True, END, tick(0))
    inbox.forget_frames()
    inbox.put_frame(Sample(Bytes(tick(1))))
    assert next(inbox.ticks(ASSIGNMENT))[0] == 1
    assert inbox.dropped == 2
    gone = inbox_of(True, END, False)
    gone.forget_frames()
    assert list(gone.ticks(ASSIGNMENT)) == []
    assert gone.ended.how == "gone"


def test_why_a_runner_ended_is_told() -> None:
    let_go = frames.encode("end", -1, {}, {"why": "no answer for 3 s"})
    for arrived, ended in ((END, ("over", "")), (let_go, ("let go", "no answer for 3 s"))):
        inbox = inbox_of(arrived)
        assert list(inbox.ticks(ASSIGNMENT)) == []
        assert inbox.ended == ended
    inbox = inbox_of(tick(0))
    ticks = inbox.ticks(ASSIGNMENT)
    assert next(ticks)[0] == 0
    inbox.leave()
    assert list(ticks) == []
    assert inbox.ended.how == "left"
    inbox.put_frame(Sample(Bytes(END)))
    inbox.wait_for_farewell()


@pytest.mark.parametrize(
    "wrong",
    [
        {"groups": None},
        {"groups": [3]},
        {"rate_hz": 0},
        {"measures": [1]},
        {"memory": "text"},
        {"memory": b"\xc1"},
        {"v": frames.VERSION - 1},
        *({"groups": [{**ASSIGNMENT.as_mapping()["groups"][0], **one}]} for one in (
            {"rows": [[1, 2]]}, {"rows": [-1]}, {"rows": [2**63]}, {"rows": ["x"]}, {"robot_names": []},
            {"keys": [1, 2]}, {"keys": [-1]}, {"params": []}, {"body": {}}, {"act_every_ticks": 0}, {"agent": 3},
        )),
    ],
    ids=repr,
)  # fmt: skip
def test_robots_that_a_world_cannot_give_are_refused(wrong: dict[str, Any]) -> None:
    given = {**ASSIGNMENT.as_mapping(), "v": frames.VERSION, "memory": None}
    assert assigned_robots(msgpack.packb(given))[0].robot_names == ("flock-0",)
    with pytest.raises(BadFrame):
        assigned_robots(msgpack.packb({**given, **wrong}))


class Deaf:
    """A session of which all but the `received`-th subscriber are told nothing of the world's token."""

    def __init__(self, received: int) -> None:
        self.received, self.declared, self.undeclared = received, 0, 0

    def liveliness(self) -> "Deaf":
        return self

    def declare_subscriber(self, _key: str, callback: Any, *, history: bool) -> "Deaf":
        assert history
        self.declared += 1
        if self.declared == self.received:
            callback(Token())
        return self

    def undeclare(self) -> None:
        self.undeclared += 1


class Token:
    kind = zenoh.SampleKind.PUT


@pytest.mark.parametrize(("received", "declared", "undeclared"), [(1, 1, 0), (3, 3, 2), (9, 4, 4)])
def test_a_runner_that_is_told_nothing_of_its_world_asks_again(
    received: int, declared: int, undeclared: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "JOIN_TIMEOUT_S", 0.04)
    monkeypatch.setattr(runner, "POLL_S", 0.01)
    session = Deaf(received)
    watched = runner._watched_world(session, Keys("run1"), TickInbox())  # pyright: ignore[reportArgumentType]
    assert (watched is None) == (received > 4)
    assert (session.declared, session.undeclared) == (declared, undeclared)


class NoAnswer:
    """A session and an answer in one: a query whose time is up, as zenoh tells of it."""

    ok = None

    def __init__(self) -> None:
        self.err = self.payload = self

    def get(self, _key: str, *, payload: bytes, timeout: float) -> list["NoAnswer"]:
        assert payload
        assert timeout
        return [self]

    def to_string(self) -> str:
        return "Timeout"


def test_a_world_that_takes_too_long_to_answer_is_named_as_what_is_wrong() -> None:
    with pytest.raises(RunnerLost, match="the world did not answer to join within") as lost:
        runner._join(NoAnswer(), Keys("run1"), "r7", NEXT_FREE)  # pyright: ignore[reportArgumentType]
    assert lost.value.runner == "r7"
