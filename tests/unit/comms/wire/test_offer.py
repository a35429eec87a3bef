"""What a world offers comes over whole, also where its robots are very many; what is no offer is refused."""

from dataclasses import asdict, replace
from typing import Any

import msgpack
import pytest

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.frames import VERSION
from swarmwire.comms.wire.join_request import MOST_BYTES
from swarmwire.comms.wire.offer import Offer, OfferedGroup


def test_an_offer_of_very_many_robots_comes_over_whole() -> None:
    free = tuple(f"flock-{at}" for at in range(100_000))
    group = OfferedGroup("flock", "mine.py:Mine", "a" * 64, len(free), free)
    offer = Offer("RUN", "many", "d" * 64, "1.2.3", 10, 1.5, (group,))
    data = offer.encode()
    assert len(data) > MOST_BYTES
    assert Offer.decode(data) == offer


GROUP = OfferedGroup("flock", "mine.py:Mine", "a" * 64, 3, ("flock-0", "flock-2"))
OFFER = Offer("RUN", "some", "d" * 64, "1.2.3", 10, None, (GROUP, replace(GROUP, name="scouts", free=())))


def told(**changed: Any) -> bytes:
    """An offer with these values in place of its own; `...` takes them out."""
    body = {"v": VERSION, **asdict(OFFER), **changed}
    return msgpack.packb({name: value for name, value in body.items() if value is not ...})


@pytest.mark.parametrize("factor", [None, 1.0, 0.5, 2])
def test_an_offer_comes_over_whole(factor: float | None) -> None:
    got = Offer.decode(replace(OFFER, real_time=factor).encode())
    assert got == replace(OFFER, real_time=factor)
    assert factor is None or type(got.real_time) is float


def test_robots_become_free_by_group() -> None:
    free = OFFER.with_free({"scouts": ["scouts-1"]})
    assert [group.free for group in free.groups] == [(), ("scouts-1",)]
    assert replace(free, groups=OFFER.groups) == OFFER


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"run": 1}, "run is no str"),
        ({"rate_hz": 10.0}, "rate_hz is no int"),
        ({"rate_hz": True}, "rate_hz is no int"),
        ({"scenario": ...}, "scenario"),
        ({"real_time": ...}, "real_time"),
        ({"real_time": "fast"}, "fast"),
        ({"real_time": []}, "list"),
        ({"groups": ...}, "groups"),
        ({"groups": [1]}, "int"),
        ({"groups": 3}, "not iterable"),
        ({"groups": [{**asdict(GROUP), "robots": "3"}]}, "robots is no int"),
        ({"groups": [{**asdict(GROUP), "free": "flock-0"}]}, "free is no list of texts"),
        ({"groups": [{**asdict(GROUP), "free": ["flock-0", 1]}]}, "free is no list of texts"),
        (
            {"groups": [{name: value for name, value in asdict(GROUP).items() if name != "agent_sha256"}]},
            "agent_sha256",
        ),
    ],
    ids=str,
)
def test_what_is_no_offer_is_refused(changed: dict[str, Any], named: str) -> None:
    with pytest.raises(BadFrame, match=f"expected an offer: .*{named}") as caught:
        Offer.decode(told(**changed))
    assert caught.value.fault == "malformed"


def test_an_offer_of_another_version_is_named() -> None:
    with pytest.raises(BadFrame, match="version") as caught:
        Offer.decode(told(v=VERSION + 1))
    assert caught.value.fault == "version"


def test_offers_cannot_be_changed() -> None:
    for thing, name in ((OFFER, "run"), (GROUP, "name")):
        with pytest.raises(AttributeError):
            setattr(thing, name, "other")
