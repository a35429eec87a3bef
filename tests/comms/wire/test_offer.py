"""What a world offers comes over whole, also where its robots are very many."""

from swarmwire.comms.wire.join_request import MOST_BYTES
from swarmwire.comms.wire.offer import Offer, OfferedGroup


def test_an_offer_of_very_many_robots_comes_over_whole() -> None:
    free = tuple(f"flock-{at}" for at in range(100_000))
    group = OfferedGroup("flock", "mine.py:Mine", "a" * 64, len(free), free)
    offer = Offer("RUN", "many", "d" * 64, "1.2.3", 10, 1.5, (group,))
    data = offer.encode()
    assert len(data) > MOST_BYTES
    assert Offer.decode(data) == offer
