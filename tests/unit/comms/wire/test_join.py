"""What a runner asks for and what a world offers come over whole; what is neither is refused."""

import re
from dataclasses import asdict, replace
from typing import Any

import msgpack
import pytest

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.frames import VERSION
from swarmwire.comms.wire.join import MAX_JOIN_BYTES, GroupInfo, JoinRequest, SessionInfo, versioned

HASH = "0123456789abcdef" * 4


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
def test_a_request_comes_over_whole(request_: JoinRequest) -> None:
    assert JoinRequest.decode(request_.encode()) == request_


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"robots": 0}, "request.robots: expected `int` >= 1"),
        ({"robots": -1}, "request.robots: expected `int` >= 1"),
        ({"robots": 2.0}, "request.robots: expected `int | null`, got `float`"),
        ({"robots": True}, "request.robots: expected `int | null`, got `bool`"),
        ({"names": []}, "request.names: expected `array` of length >= 1"),
        ({"names": ["flock-0", 1]}, "request.names[1]: expected `str`, got `int`"),
        ({"names": "flock-0"}, "request.names: expected `array | null`, got `str`"),
        ({"names": {"flock-0": 1}}, "request.names: expected `array | null`, got `object`"),
        ({"robots": 1, "names": ["flock-0"]}, "expected robots or names, not both"),
        ({"agents": [HASH]}, "request.agents: expected `object | null`, got `array`"),
        ({"agents": {"flock": HASH[1:]}}, "request.agents[...]: expected `str` matching regex"),
        ({"agents": {"flock": HASH, "scouts": 1}}, "request.agents[...]: expected `str`, got `int`"),
        ({"agents": {1: HASH}}, "no msgpack"),
        ({"agents": {b"flock": HASH}}, "request: expected `str`, got `bytes` - at `key` in `$.agents`"),
        ({"scenario_sha256": HASH + "0"}, "request.scenario_sha256: expected `str` matching regex"),
        ({"scenario_sha256": HASH + "\n"}, "request.scenario_sha256: expected `str` matching regex"),
        ({"scenario_sha256": HASH.upper()}, "request.scenario_sha256: expected `str` matching regex"),
        ({"scenario_sha256": HASH.encode()}, "request.scenario_sha256: expected `str | null`, got `bytes`"),
    ],
    ids=str,
)
def test_what_is_no_request_is_refused(asked: dict[str, Any], told: str) -> None:
    with pytest.raises(BadFrame, match=re.escape(told)) as caught:
        JoinRequest.decode(msgpack.packb({"v": VERSION, **asked}))
    assert caught.value.fault == "malformed"


@pytest.mark.parametrize("version", [VERSION + 1, VERSION - 1, float(VERSION), None, str(VERSION)])
def test_another_version_is_named(version: object) -> None:
    with pytest.raises(BadFrame, match=f"expected version {VERSION} of the frames, got {version!r}") as caught:
        versioned(msgpack.packb({"v": version}))
    assert caught.value.fault == "version"


@pytest.mark.parametrize("body", [[], ["v"], 1, None, {b"v": VERSION}, {"v": VERSION, b"robots": 1}], ids=str)
def test_what_is_no_map_of_texts_is_refused(body: object) -> None:
    with pytest.raises(BadFrame, match="message: expected"):
        versioned(msgpack.packb(body))


def test_a_request_may_have_a_megabyte_and_no_more() -> None:
    empty = len(msgpack.packb({"v": VERSION, "x": bytes(2**17)})) - 2**17
    assert MAX_JOIN_BYTES == 2**20
    assert versioned(msgpack.packb({"v": VERSION, "x": bytes(MAX_JOIN_BYTES - empty)}))["v"] == VERSION
    with pytest.raises(BadFrame, match="oversized"):
        versioned(msgpack.packb({"v": VERSION, "x": bytes(MAX_JOIN_BYTES - empty + 1)}))


def test_a_session_info_of_very_many_robots_comes_over_whole() -> None:
    free = tuple(f"flock-{at}" for at in range(100_000))
    group = GroupInfo("flock", "mine.py:Mine", "a" * 64, len(free), free)
    session_info = SessionInfo("RUN", "many", "d" * 64, "1.2.3", 10, 1.5, (group,))
    data = session_info.encode()
    assert len(data) > MAX_JOIN_BYTES
    assert SessionInfo.decode(data) == session_info


GROUP = GroupInfo("flock", "mine.py:Mine", "a" * 64, 3, ("flock-0", "flock-2"))
OFFER = SessionInfo("RUN", "some", "d" * 64, "1.2.3", 10, None, (GROUP, replace(GROUP, name="scouts", free=())))


def told(**changed: Any) -> bytes:
    """A session info with these values in place of its own; `...` takes them out."""
    body = {"v": VERSION, **asdict(OFFER), **changed}
    return msgpack.packb({name: value for name, value in body.items() if value is not ...})


@pytest.mark.parametrize("factor", [None, 1.0, 0.5, 2])
def test_a_session_info_comes_over_whole(factor: float | None) -> None:
    got = SessionInfo.decode(replace(OFFER, real_time=factor).encode())
    assert got == replace(OFFER, real_time=factor)
    assert factor is None or type(got.real_time) is float


def test_robots_become_free_by_group() -> None:
    free = OFFER.with_free({"scouts": ["scouts-1"]})
    assert [group.free for group in free.groups] == [(), ("scouts-1",)]
    assert replace(free, groups=OFFER.groups) == OFFER


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"run": 1}, ".run: expected `str`"),
        ({"rate_hz": 10.0}, ".rate_hz: expected `int`"),
        ({"rate_hz": True}, ".rate_hz: expected `int`"),
        ({"scenario": ...}, ": object missing required field `scenario`"),
        ({"real_time": ...}, ": object missing required field `real_time`"),
        ({"real_time": "fast"}, ".real_time: expected `float | null`"),
        ({"real_time": "1.5"}, ".real_time: expected `float | null`"),
        ({"real_time": []}, ".real_time: expected `float | null`"),
        ({"groups": ...}, ": object missing required field `groups`"),
        ({"groups": [1]}, ".groups[0]: expected `object`, got `int`"),
        ({"groups": 3}, ".groups: expected `array`, got `int`"),
        ({"groups": [{**asdict(GROUP), "robots": "3"}]}, ".groups[0].robots: expected `int`"),
        ({"groups": [{**asdict(GROUP), "free": "flock-0"}]}, ".groups[0].free: expected `array`, got `str`"),
        ({"groups": [{**asdict(GROUP), "free": ["flock-0", 1]}]}, ".groups[0].free[1]: expected `str`, got `int`"),
        (
            {"groups": [{name: value for name, value in asdict(GROUP).items() if name != "agent_sha256"}]},
            ".groups[0]: object missing required field `agent_sha256`",
        ),
    ],
    ids=str,
)
def test_what_is_no_session_info_is_refused(changed: dict[str, Any], named: str) -> None:
    with pytest.raises(BadFrame, match=re.escape(f"session info{named}")) as caught:
        SessionInfo.decode(told(**changed))
    assert caught.value.fault == "malformed"


def test_a_session_info_of_another_version_is_named() -> None:
    with pytest.raises(BadFrame, match="version") as caught:
        SessionInfo.decode(told(v=VERSION + 1))
    assert caught.value.fault == "version"


def test_offers_cannot_be_changed() -> None:
    for thing, name in ((OFFER, "run"), (GROUP, "name")):
        with pytest.raises(AttributeError):
            setattr(thing, name, "other")
