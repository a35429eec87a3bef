"""What is asked of a run arrives as it was sent; what cannot be meant is refused; an inbox counts what it drops."""

import threading

import msgpack
import pytest

from swarmwire.comms.errors import BadFrame, BadInput
from swarmwire.comms.wire.control_frames import (
    MAX_BYTES,
    ControlRequest,
    decode_reply,
    decode_request,
    encode_reply,
    encode_request,
)
from swarmwire.comms.wire.radio_bridge import BoundedInbox

KILL = {"do": "kill", "robots": {"names": ["flock-1"]}}


@pytest.mark.parametrize(
    "request_",
    [
        ControlRequest("pause"),
        ControlRequest("resume"),
        ControlRequest("stop"),
        ControlRequest("step", 3),
        ControlRequest("speed", 0.5),
        ControlRequest("speed", None),
        ControlRequest("event", KILL),
        ControlRequest("end", 4),
    ],
    ids=lambda request: f"{request.do} {request.value}",
)
def test_a_request_arrives_as_it_was_sent(request_):
    assert decode_request(encode_request(request_)) == request_


def test_a_step_is_one_tick_and_a_whole_speed_is_a_number():
    assert decode_request(msgpack.packb({"v": 1, "do": "step"})) == ControlRequest("step", 1)
    assert decode_request(msgpack.packb({"v": 1, "do": "speed", "factor": 2})) == ControlRequest("speed", 2.0)
    assert decode_request(msgpack.packb({"v": 1, "do": "speed"})) == ControlRequest("speed", None)


def test_a_request_cannot_be_changed_on_its_way():
    with pytest.raises(AttributeError):
        ControlRequest("pause").do = "stop"


def test_a_million_ticks_may_be_asked_for_and_no_more():
    assert decode_request(encode_request(ControlRequest("step", 10**6))).value == 10**6
    with pytest.raises(BadInput, match="from 1 to 1000000, got 1000001"):
        decode_request(encode_request(ControlRequest("step", 10**6 + 1)))


def of_bytes(count):
    """A map of version 1 with so many bytes: nine are for the keys and the length of the rest, or eleven."""
    data = msgpack.packb({"v": 1, "x": bytes(count - (9 if count < 2**16 + 9 else 11))})
    assert len(data) == count
    return data


def test_a_request_may_have_64_kilobytes_and_an_answer_16_megabytes():
    with pytest.raises(BadInput, match="do: expected one of"):  # it was read
        decode_request(of_bytes(2**16))
    with pytest.raises(BadInput, match="oversized"):
        decode_request(of_bytes(2**16 + 1))
    assert decode_reply(of_bytes(2**24))["v"] == 1
    with pytest.raises(BadFrame, match="oversized"):
        decode_reply(of_bytes(2**24 + 1))


@pytest.mark.parametrize(
    ("value", "shown"),
    [("x" * 58, "got '" + "x" * 58 + "'"), ("x" * 59, "got '" + "x" * 56 + "...")],
)
def test_a_long_value_is_shown_by_its_beginning(value, shown):
    with pytest.raises(BadInput) as caught:
        decode_request(msgpack.packb({"v": 1, "do": "end", "event": value}))
    assert str(caught.value).endswith(shown)


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ({}, "v: expected version 1 of control, got None"),
        ({"v": True}, "v: expected version 1"),
        ({"v": 2, "do": "pause"}, "v: expected version 1"),
        ({"v": 0, "do": "pause"}, "v: expected version 1"),
        ({"v": 1}, "do: expected one of pause, resume"),
        ({"v": 1, "do": "paus"}, "did you mean pause?"),
        ({"v": 1, "do": ["pause"]}, "do: expected one of"),
        ({"v": 1, "do": "pause", "n": 1}, "n: unknown key of 'pause'; expected none"),
        ({"v": 1, "do": "step", "n": 0}, "n: expected a whole number of ticks from 1 to"),
        ({"v": 1, "do": "step", "n": 2.0}, "n: expected a whole number"),
        ({"v": 1, "do": "speed", "factor": "fast"}, "factor: expected simulated seconds per second"),
        ({"v": 1, "do": "speed", "factor": float("nan")}, "factor: expected simulated seconds per second"),
        ({"v": 1, "do": "end", "event": True}, "event: expected the number of an event, got True"),
        ({"v": 1, "do": "event", "event": "kill"}, "event: expected a table as in a scenario"),
        ({"v": 1, "do": "event", "event": {"do": "kill", 1: 2}}, "expected"),
        ([1], "expected a request"),
        (["v"], "expected a request"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_one_line(asked, line):
    with pytest.raises(BadInput, match="^[^\n]*$") as caught:
        decode_request(msgpack.packb(asked))
    assert line in str(caught.value)


@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x93" * 5000, bytes(MAX_BYTES + 1)])
def test_bytes_that_are_no_request_are_refused(data):
    with pytest.raises(BadInput, match="expected a request"):
        decode_request(data)


def test_an_answer_of_another_version_or_none_is_a_bad_frame():
    assert decode_reply(encode_reply({"done": "paused", "tick": 3})) == {"v": 1, "done": "paused", "tick": 3}
    for data in (b"", msgpack.packb({"v": 2}), msgpack.packb({"v": 0}), msgpack.packb([1])):
        with pytest.raises(BadFrame):
            decode_reply(data)


@pytest.mark.parametrize(
    "value",
    [2**64, {"n": -(2**63) - 1}, {"x": object()}, {"x": "\ud800"}],
    ids=["2^64", "below int64", "an object", "half a letter"],
)
def test_what_no_message_can_carry_is_refused_by_whoever_asks(value):
    with pytest.raises(BadInput, match="event: expected texts, numbers of at most 64 bits, lists and tables alone"):
        encode_request(ControlRequest("event", value))


def test_what_waits_comes_once_in_order_and_what_has_no_room_is_counted():
    inbox = BoundedInbox[int](3)
    for item in range(5):
        inbox.put(item)
    assert inbox.take() == [0, 1, 2]
    assert inbox.take() == []
    inbox.put(7)
    assert inbox.take() == [7]
    assert inbox.dropped == 2


def test_nothing_is_lost_uncounted_when_several_threads_put():
    inbox, taken = BoundedInbox[int](50), list[int]()
    threads = [threading.Thread(target=lambda: [inbox.put(item) for item in range(2000)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        taken += inbox.take()
    taken += inbox.take()
    assert len(taken) + inbox.dropped == 8000
