"""The table of packets as frames: one per packet on air, with what became of it where."""

import polars as pl

from swarmwire.metrics.capture.frame import Frame
from swarmwire.metrics.capture.frames_on_air import frames_on_air
from swarmwire.metrics.record.packet_columns import packet_schema

NAMES = ("a-0", "a-1", "a-2")


def table(*rows: dict[str, object]) -> pl.DataFrame:
    usual = {"arena": 0, "sender": 0, "receivers": 1, "sequence": 0, "size_bytes": 4, "topic": "Beacon"}
    whole = [{**dict.fromkeys(packet_schema()), **usual, **row} for row in rows]
    return pl.DataFrame(whole, schema=packet_schema())


def test_a_packet_is_one_frame_with_the_fate_at_each_receiver():
    one = {"on_air_at_ns": 70, "payload": b"told"}
    seen = table(
        {**one, "receiver": 2, "fate": "collided", "rssi_dbm": -80.0},
        {**one, "receiver": 1, "fate": "heard", "rssi_dbm": -61.5},
        {"sequence": 1, "receiver": None, "fate": "channel_busy", "on_air_at_ns": 90},
    )
    told = ("a-0 to all: Beacon, packet 0", "heard: a-1 -61.5 dBm", "collided: a-2 -80.0 dBm")
    assert list(frames_on_air(seen, NAMES)) == [Frame(70, 0, None, 0, 4, b"told", -61.5, told)]


def test_frames_are_in_the_order_of_time_and_addressed_ones_say_to_whom():
    seen = table(
        {"sequence": 7, "receiver": 1, "to": 1, "fate": "lost", "on_air_at_ns": 5},
        {"sender": 2, "receiver": 0, "fate": "heard", "on_air_at_ns": 3},
        {"sender": 1, "receiver": 0, "fate": "heard", "on_air_at_ns": 3},
    )
    found = list(frames_on_air(seen, NAMES))
    assert [(frame.on_air_at_ns, frame.sender, frame.to) for frame in found] == [(3, 1, None), (3, 2, None), (5, 0, 1)]
    assert found[2].comments == ("a-0 to a-1: Beacon, packet 7", "lost: a-1")
    assert (found[2].payload, found[2].rssi_dbm) == (b"", None)


def test_a_record_without_payloads_and_addresses_has_frames_too():
    old = table({"receiver": 1, "fate": "heard", "on_air_at_ns": 5}).drop("to", "payload")
    assert [(frame.to, frame.payload) for frame in frames_on_air(old, NAMES)] == [(None, b"")]
