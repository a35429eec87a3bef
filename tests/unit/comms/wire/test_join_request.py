"""What a runner asks for comes over whole; what is no request is refused, and another version is named."""

import re
from typing import Any

import msgpack
import pytest

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.frames import VERSION
from swarmwire.comms.wire.join_request import MOST_BYTES, JoinRequest, versioned

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


def test_a_request_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        JoinRequest().robots = 3  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"robots": 0}, "robots: expected a number of at least 1"),
        ({"robots": -1}, "robots: expected a number of at least 1"),
        ({"robots": 2.0}, "robots: expected a number of at least 1"),
        ({"robots": True}, "robots: expected a number of at least 1"),
        ({"names": []}, "names: expected a list of names of robots"),
        ({"names": ["flock-0", 1]}, "names: expected a list of names of robots"),
        ({"names": "flock-0"}, "names: expected a list of names of robots"),
        ({"names": {"flock-0": 1}}, "names: expected a list of names of robots"),
        ({"robots": 1, "names": ["flock-0"]}, "expected robots or names, not both"),
        ({"agents": [HASH]}, "agents: expected the sha256 of an agent by group"),
        ({"agents": {"flock": HASH[1:]}}, "agents: expected the sha256 of an agent by group"),
        ({"agents": {"flock": HASH, "scouts": 1}}, "agents: expected the sha256 of an agent by group"),
        ({"agents": {1: HASH}}, "no msgpack"),
        ({"agents": {b"flock": HASH}}, "agents: expected the sha256 of an agent by group"),
        ({"scenario_sha256": HASH + "0"}, "scenario_sha256: expected 64 hexadecimal digits"),
        ({"scenario_sha256": HASH.upper()}, "scenario_sha256: expected 64 hexadecimal digits"),
        ({"scenario_sha256": HASH.encode()}, "scenario_sha256: expected 64 hexadecimal digits"),
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
    with pytest.raises(BadFrame, match="expected a map"):
        versioned(msgpack.packb(body))


def test_a_request_may_have_a_megabyte_and_no_more() -> None:
    empty = len(msgpack.packb({"v": VERSION, "x": bytes(2**17)})) - 2**17
    assert MOST_BYTES == 2**20
    assert versioned(msgpack.packb({"v": VERSION, "x": bytes(MOST_BYTES - empty)}))["v"] == VERSION
    with pytest.raises(BadFrame, match="oversized"):
        versioned(msgpack.packb({"v": VERSION, "x": bytes(MOST_BYTES - empty + 1)}))
