"""Blocks of pcapng, byte by byte as the specification has them, and read back by a reader of their own."""

from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.capture import pcapng
from tests.support.metrics.capture.reading import Captured, read


def test_blocks_are_those_of_the_specification():
    section = "0a0d0d0a 28000000 4d3c2b1a 0100 0000 ffffffffffffffff 0400 0200 73770000 00000000 28000000"
    assert pcapng.section("sw").hex() == section.replace(" ", "")
    interface = (
        "01000000 30000000 1b01 0000 00000000"
        " 0200 0300 61697200 0300 0200 68690000 0900 0100 09000000 00000000 30000000"
    )
    assert pcapng.interface(283, "air", "hi").hex() == interface.replace(" ", "")
    packet = "06000000 28000000 00000000 01000000 02000000 05000000 09000000 0102030405000000 28000000"
    assert pcapng.packet(2**32 + 2, bytes([1, 2, 3, 4, 5]), 9).hex() == packet.replace(" ", "")


PACKETS = st.lists(
    st.builds(
        Captured, st.integers(0, 2**63), st.binary(max_size=40), st.integers(40, 99), st.lists(st.text(), max_size=3)
    )
)


@given(PACKETS)
def test_what_was_written_is_read_back(tmp_path_factory, packets: list[Captured]):
    path = tmp_path_factory.mktemp("capture") / "some.pcapng"
    blocks = [pcapng.packet(one.at_ns, one.data, one.length, one.comments) for one in packets]
    path.write_bytes(pcapng.section("s") + pcapng.interface(147, "n", "d") + b"".join(blocks))
    found = read(path)
    assert (found.section, found.interface) == ({4: [b"s"]}, {2: [b"n"], 3: [b"d"], 9: [b"\x09"]})
    assert (found.link_type, found.packets) == (147, packets)


def test_a_comment_too_long_for_an_option_is_cut_between_characters(tmp_path):
    path = tmp_path / "long.pcapng"
    path.write_bytes(
        pcapng.section("s") + pcapng.interface(147, "n", "d") + pcapng.packet(0, b"", 0, ["é" * 40_000, "next"])
    )
    assert read(path).packets[0].comments == ["é" * 32_767, "next"]
