"""The header of a packet on the robots' network."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.radios.packet_header import HEADER_BYTES, PacketHeader
from swarmwire.comms.errors import BadFrame

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
