"""What a world offers comes over whole, also where its robots are very many, and nothing else is taken for an offer."""

from typing import Any

import msgpack
import pytest

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.join_request import MOST_BYTES
from swarmwire.comms.wire.offer import Offer, OfferedGroup

GROUP = OfferedGroup("flock", "mine.py:Mine", "a" * 64, 2, ("flock-0", "flock-1"))
OFFER = Offer("RUN", "many", "d" * 64, "1.2.3", 10, None, (GROUP,))


def changed(change: dict[str, Any]) -> bytes:
    """The offer with other values, or without those that are `...`."""
    told = {**msgpack.unpackb(OFFER.encode()), **change}
    return msgpack.packb({key: value for key, value in told.items() if value is not ...})


def of_group(change: dict[str, Any]) -> dict[str, Any]:
    """A change of the offer: its group is another."""
    group = {**msgpack.unpackb(OFFER.encode())["groups"][0], **change}
    return {"groups": [{key: value for key, value in group.items() if value is not ...}]}


def test_an_offer_of_very_many_robots_comes_over_whole() -> None:
    free = tuple(f"flock-{at}" for at in range(100_000))
    group = OfferedGroup("flock", "mine.py:Mine", "a" * 64, len(free), free)
    offer = Offer("RUN", "many", "d" * 64, "1.2.3", 10, 1.5, (group,))
    data = offer.encode()
    assert len(data) > MOST_BYTES
    assert Offer.decode(data) == offer


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"groups": ...}, "groups"),
        ({"groups": 3}, "not iterable"),
        ({"run": 7}, "run is no str"),
        ({"rate_hz": 10.0}, "rate_hz is no int"),
        ({"rate_hz": True}, "rate_hz is no int"),
        ({"real_time": "fast"}, "could not convert"),
        (of_group({"free": "flock-0"}), "free is no list of texts"),
        (of_group({"free": ["flock-0", 1]}), "free is no list of texts"),
        (of_group({"robots": "2"}), "robots is no int"),
        (of_group({"agent": ...}), "agent"),
    ],
)
def test_an_offer_of_another_form_is_refused(change: dict[str, Any], fault: str) -> None:
    with pytest.raises(BadFrame, match=fault):
        Offer.decode(changed(change))
