"""Requests to join a run, and to control it."""

import re
import threading
from dataclasses import asdict, replace
from typing import Any

import msgpack
import pytest

from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.wire.control_frames import (
    MAX_BYTES,
    ControlRequest,
    decode_reply,
    decode_request,
    encode_reply,
    encode_request,
)
from swarmwire.comms.wire.frames import VERSION
from swarmwire.comms.wire.join import MAX_JOIN_BYTES, GroupInfo, JoinRequest, SessionInfo, versioned
from swarmwire.comms.wire.radio_bridge import BoundedInbox
from tests.support.refusals import refused_frame, refused_input

HASH = "0123456789abcdef" * 4
GROUP = GroupInfo("flock", "mine.py:Mine", "a" * 64, 3, ("flock-0", "flock-2"))
OFFER = SessionInfo("RUN", "some", "d" * 64, "1.2.3", 10, None, (GROUP, replace(GROUP, name="scouts", free=())))
KILL = {"do": "kill", "robots": {"names": ["flock-1"]}}


@pytest.mark.parametrize(
    "request_",
    [
        JoinRequest(),
        JoinRequest(robots=1),
        JoinRequest(robots=7, agents={}, scenario_sha256=HASH),
        JoinRequest(names=("flock-0",)),
        JoinRequest(names=("flock-0", "scouts-3"), agents={"flock": HASH, "scouts": "f" * 64}),
    ],
    ids=str,
)
def test_join_request_survives_encoding(request_: JoinRequest) -> None:
    assert JoinRequest.decode(request_.encode()) == request_


@pytest.mark.parametrize(
    ("values", "message"),
    [
        *(({"robots": value}, "request.robots: ") for value in (0, -1, 2.0, True)),
        *(({"names": value}, "request.names: ") for value in ([], "flock-0", {"flock-0": 1})),
        ({"names": ["flock-0", 1]}, "request.names[1]: "),
        ({"robots": 1, "names": ["flock-0"]}, "expected robots or names, not both"),
        *(({"agents": agents}, "request.agents") for agents in ([HASH], {"flock": HASH[1:]}, {"a": HASH, "b": 1})),
        ({"agents": {1: HASH}}, "no msgpack"),
        ({"agents": {b"flock": HASH}}, "at `key` in `$.agents`"),
        *(
            ({"scenario_sha256": value}, "request.scenario_sha256: ")
            for value in (f"{HASH}0", f"{HASH}\n", HASH.upper(), HASH.encode())
        ),
    ],
    ids=str,
)
def test_join_request_that_is_invalid_is_malformed(values: dict[str, Any], message: str) -> None:
    with refused_frame("malformed", re.escape(message)):
        JoinRequest.decode(msgpack.packb({"v": VERSION, **values}))


def offer_with(**changed: Any) -> bytes:
    """A session info with these values in place of its own; `...` takes them out."""
    body = {"v": VERSION, **asdict(OFFER), **changed}
    return msgpack.packb({name: value for name, value in body.items() if value is not ...})


@pytest.mark.parametrize("version", [VERSION + 1, VERSION - 1, float(VERSION), None, str(VERSION)])
def test_message_of_another_version_is_refused(version: object) -> None:
    for decode in (versioned, SessionInfo.decode, JoinRequest.decode):
        with refused_frame("version"):
            decode(offer_with(v=version))


@pytest.mark.parametrize("body", [[], ["v"], 1, None, {b"v": VERSION}, {"v": VERSION, b"robots": 1}], ids=str)
def test_join_message_that_is_no_map_of_texts_is_refused(body: object) -> None:
    with pytest.raises(BadFrame, match="message: expected"):
        versioned(msgpack.packb(body))


def test_join_message_is_limited_to_a_megabyte() -> None:
    empty = len(msgpack.packb({"v": VERSION, "x": bytes(2**17)})) - 2**17
    assert MAX_JOIN_BYTES == 2**20
    assert versioned(msgpack.packb({"v": VERSION, "x": bytes(MAX_JOIN_BYTES - empty)}))["v"] == VERSION
    with pytest.raises(BadFrame, match="oversized"):
        versioned(msgpack.packb({"v": VERSION, "x": bytes(MAX_JOIN_BYTES - empty + 1)}))


def test_session_info_of_very_many_robots_survives() -> None:
    free = tuple(f"flock-{at}" for at in range(100_000))
    session_info = replace(OFFER, groups=(replace(GROUP, robots=len(free), free=free),))
    data = session_info.encode()
    assert len(data) > MAX_JOIN_BYTES
    assert SessionInfo.decode(data) == session_info


@pytest.mark.parametrize("factor", [None, 1.0, 0.5, 2])
def test_session_info_survives_encoding(factor: float | None) -> None:
    got = SessionInfo.decode(replace(OFFER, real_time=factor).encode())
    assert got == replace(OFFER, real_time=factor)
    assert factor is None or type(got.real_time) is float


def test_session_info_lists_free_robots_by_group() -> None:
    free = OFFER.with_free({"scouts": ["scouts-1"]})
    assert [group.free for group in free.groups] == [(), ("scouts-1",)]
    assert replace(free, groups=OFFER.groups) == OFFER


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"run": 1}, ".run: "),
        *(({"rate_hz": value}, ".rate_hz: ") for value in (10.0, True)),
        *(({name: ...}, f": object missing required field `{name}`") for name in ("scenario", "real_time", "groups")),
        *(({"real_time": value}, ".real_time: ") for value in ("fast", "1.5", [])),
        *(({"groups": [1]}, ".groups[0]: "), ({"groups": 3}, ".groups: ")),
        ({"groups": [{**asdict(GROUP), "robots": "3"}]}, ".groups[0].robots: "),
        ({"groups": [{**asdict(GROUP), "free": "flock-0"}]}, ".groups[0].free: "),
        ({"groups": [{**asdict(GROUP), "free": ["flock-0", 1]}]}, ".groups[0].free[1]: "),
        (
            {"groups": [{name: value for name, value in asdict(GROUP).items() if name != "agent_sha256"}]},
            ".groups[0]: object missing required field `agent_sha256`",
        ),
    ],
    ids=str,
)
def test_session_info_that_is_invalid_is_malformed(changed: dict[str, Any], named: str) -> None:
    with refused_frame("malformed", re.escape(f"session info{named}")):
        SessionInfo.decode(offer_with(**changed))


@pytest.mark.parametrize(
    "request_",
    [
        ControlRequest("pause"),
        ControlRequest("resume"),
        ControlRequest("stop"),
        ControlRequest("step", 3),
        ControlRequest("step", 10**6),
        ControlRequest("speed", 0.5),
        ControlRequest("speed", None),
        ControlRequest("event", KILL),
        ControlRequest("end", 4),
    ],
    ids=lambda request: f"{request.do} {request.value}",
)
def test_control_request_survives_encoding(request_):
    assert decode_request(encode_request(request_)) == request_


def test_control_request_defaults_to_one_step_and_a_float_speed():
    assert decode_request(msgpack.packb({"v": 1, "do": "step"})) == ControlRequest("step", 1)
    assert decode_request(msgpack.packb({"v": 1, "do": "speed", "factor": 2})) == ControlRequest("speed", 2.0)
    assert decode_request(msgpack.packb({"v": 1, "do": "speed"})) == ControlRequest("speed", None)


def of_bytes(count):
    """A map of version 1 with so many bytes: nine are for the keys and the length of the rest, or eleven."""
    data = msgpack.packb({"v": 1, "x": bytes(count - (9 if count < 2**16 + 9 else 11))})
    assert len(data) == count
    return data


def test_control_request_is_limited_to_64_kb_and_a_reply_to_16_mb():
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
def test_control_refusal_shortens_long_values(value, shown):
    with pytest.raises(BadInput) as caught:
        decode_request(msgpack.packb({"v": 1, "do": "end", "event": value}))
    assert str(caught.value).endswith(shown)


@pytest.mark.parametrize(
    ("values", "key"),
    [
        *((values, "v") for values in ({}, {"v": True}, {"v": 2, "do": "pause"}, {"v": 0, "do": "pause"})),
        *((values, "do") for values in ({"v": 1}, {"v": 1, "do": "paus"}, {"v": 1, "do": ["pause"]})),
        ({"v": 1, "do": "pause", "n": 1}, "n"),
        *(({"v": 1, "do": "step", "n": value}, "n") for value in (0, 2.0, 10**6 + 1)),
        *(({"v": 1, "do": "speed", "factor": value}, "factor") for value in ("fast", float("nan"))),
        *(({"v": 1, "do": "end", "event": True}, "event"), ({"v": 1, "do": "event", "event": "kill"}, "event")),
        *((values, None) for values in ({"v": 1, "do": "event", "event": {"do": "kill", 1: 2}}, [1], ["v"])),
    ],
)
def test_control_request_that_is_invalid_is_refused_by_its_key(values, key):
    with refused_input(key=key):
        decode_request(msgpack.packb(values))


@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x93" * 5000, bytes(MAX_BYTES + 1)])
def test_control_request_of_other_bytes_is_refused(data):
    with pytest.raises(BadInput, match="expected a request"):
        decode_request(data)


def test_control_reply_of_another_version_is_a_bad_frame():
    assert decode_reply(encode_reply({"done": "paused", "tick": 3})) == {"v": 1, "done": "paused", "tick": 3}
    for data in (b"", msgpack.packb({"v": 2}), msgpack.packb({"v": 0}), msgpack.packb([1])):
        with pytest.raises(BadFrame):
            decode_reply(data)


@pytest.mark.parametrize(
    "value",
    [2**64, {"n": -(2**63) - 1}, {"x": object()}, {"x": "\ud800"}],
    ids=["2^64", "below int64", "an object", "half a letter"],
)
def test_control_event_that_is_not_plain_is_refused_at_the_sender(value):
    with pytest.raises(BadInput, match="event: expected texts, numbers of at most 64 bits, lists and tables alone"):
        encode_request(ControlRequest("event", value))


def test_inbox_pops_once_in_order_and_counts_drops():
    inbox = BoundedInbox[int](3)
    for item in range(5):
        inbox.put(item)
    assert inbox.pop_all() == [0, 1, 2]
    assert inbox.pop_all() == []
    inbox.put(7)
    assert inbox.pop_all() == [7]
    assert inbox.dropped == 2


def test_inbox_counts_every_drop_of_several_threads():
    inbox, items = BoundedInbox[int](50), list[int]()
    threads = [threading.Thread(target=lambda: [inbox.put(item) for item in range(2000)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        items += inbox.pop_all()
    items += inbox.pop_all()
    assert len(items) + inbox.dropped == 8000
