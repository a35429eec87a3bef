"""What a link counts: packets that arrived, and numbers that are missing between them."""

import math

from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.radios.links import Link


def link(*packets: tuple[int, int]) -> Link:
    """A link over which packets with these numbers and times of sending came."""
    made = Link()
    for at, (sequence, sent_ns) in enumerate(packets):
        made.add(sequence, sent_ns, at)
    return made


@given(st.sets(st.integers(0, 60), min_size=1))
def test_what_lies_between_the_first_and_the_last_and_did_not_come_is_missed(numbers):
    made = link(*((number, 10 * number + 1) for number in sorted(numbers)))
    assert (made.heard, made.missed) == (len(numbers), max(numbers) - min(numbers) + 1 - len(numbers))
    assert made.delivery == len(numbers) / (max(numbers) - min(numbers) + 1)


def test_a_packet_that_was_overtaken_fills_its_gap():
    made = link((0, 1), (2, 3), (1, 2), (3, 4))
    assert (made.heard, made.missed) == (4, 0)


def test_a_sender_that_began_anew_has_lost_nothing():
    made = link((5, 100), (7, 101), (0, 200), (1, 201), (3, 202))
    assert (made.heard, made.missed) == (5, 2)


def test_nobody_heard_is_no_share():
    assert math.isnan(Link().delivery)
