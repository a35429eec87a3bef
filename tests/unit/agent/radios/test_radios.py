"""What a link counts, and the header of a packet on the robots' network."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.radios.zenoh_radio import HEADER_BYTES, LinkStatistics, PacketHeader
from swarmwire.comms.errors import BadFrame


def link(*packets: tuple[int, int]) -> LinkStatistics:
    """A link over which packets with these numbers and times of sending came."""
    made = LinkStatistics()
    for at, (sequence, sent_ns) in enumerate(packets):
        made.add(sequence, sent_ns, at)
    return made


@given(st.sets(st.integers(0, 60), min_size=1))
def test_what_lies_between_the_first_and_the_last_and_did_not_come_is_missed(numbers):
    made = link(*((number, 10 * number + 1) for number in sorted(numbers)))
    assert (made.received, made.missed) == (len(numbers), max(numbers) - min(numbers) + 1 - len(numbers))
    assert made.delivery == len(numbers) / (max(numbers) - min(numbers) + 1)


def test_a_packet_that_was_overtaken_fills_its_gap():
    made = link((0, 1), (2, 3), (1, 2), (3, 4))
    assert (made.received, made.missed) == (4, 0)


def test_a_sender_that_began_anew_has_lost_nothing():
    made = link((5, 100), (7, 101), (0, 200), (1, 201), (3, 202))
    assert (made.received, made.missed) == (5, 2)


def test_nobody_received_is_no_share():
    assert math.isnan(LinkStatistics().delivery)


headers = st.builds(
    PacketHeader, st.integers(-1, 2**15 - 1), st.integers(0, 2**32 - 1), st.integers(-(2**63), 2**63 - 1)
)


@given(headers, st.binary(max_size=20))
def test_what_was_packed_comes_back_whatever_follows(header, message):
    assert PacketHeader.decode(header.encode() + message) == header
    assert len(header.encode()) == HEADER_BYTES


@given(st.binary(max_size=40))
def test_any_bytes_are_a_header_or_malformed(data):
    try:
        header = PacketHeader.decode(data)
    except BadFrame as error:
        assert error.fault == "malformed"  # noqa: PT017 - most bytes are none
    else:
        assert header.encode() == data[:HEADER_BYTES]


def test_another_version_is_malformed():
    data = PacketHeader(-1, 0, 0).encode()
    with pytest.raises(BadFrame):
        PacketHeader.decode(b"\2" + data[1:])


def test_after_the_last_number_comes_the_first():
    assert PacketHeader.decode(PacketHeader(-1, 2**32, 0).encode()).sequence == 0
