"""What the medium tells robots, between ticks too, and poses: over whole, or refused."""

import math
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.radio_bridge import (
    MAX_RADIO_FRAME_BYTES,
    POSE_BYTES,
    BridgeInfo,
    Pose,
    decode_bridged,
    decode_pose,
    encode_bridged,
    encode_pose,
)
from swarmwire.comms.wire.tick_frames import decode_packets, decode_sent, encode_packets, encode_sent
from tests.support.agent.hosts import MEASURES, received_from
from tests.support.comms.equality import equal
from tests.support.refusals import refused_frame

ROW = 4  # of the robot, in the world; in its arena there are two
TERMS = BridgeInfo(ROW, ("a", "b"), 10, 100, ("range_m", "bearing_rad"), ())
# From both robots of the arena; the first message was received twice, and the last is empty.
RECEIVED = ReceivedPackets(
    receiver=np.array([ROW, ROW, ROW]),
    sender_index=np.array([0, 1, 1]),
    sequence=np.array([7, 0, 1]),
    received_at_ns=np.array([10, 20, 30]),
    measured={"range_m": np.array([0.5, 1.0, 1.5]), "bearing_rad": np.array([-1.0, 0.0, 1.0])},
    payload=np.array([0, 0, 1]),
    payloads=Payloads.from_rows([b"abc", b""]),
)
STATUSES = TxStatuses(np.array([ROW, ROW]), np.array([0, 5]), np.array([1, 0]))


def changed(**arrays: Any) -> bytes:
    """A valid frame except for these arrays; the prefix `received_` stands for `received/`."""
    frame = frames.decode(encode_bridged(3, ROW, RECEIVED, STATUSES))
    wrong = {name.replace("received_", "received/"): array for name, array in arrays.items()}
    return frames.encode(frame.kind, frame.tick, {**frame.arrays, **wrong})


def numbers(**columns: list[int]) -> np.ndarray[Any, Any]:
    """The table of what was received, with these columns in place of its own."""
    received = replace(RECEIVED, **{name: np.array(column) for name, column in columns.items()})
    return np.array(
        (received.receiver, received.sender_index, received.sequence, received.received_at_ns, received.payload)
    )


def test_bridged_frame_survives_encoding() -> None:
    none = ReceivedPackets.none(TERMS.measures), NO_TX_STATUSES
    for tick, (received, tx_status) in enumerate((none, (RECEIVED, STATUSES))):
        frame = encode_bridged(tick, ROW, received, tx_status)
        assert equal(decode_bridged(frame, TERMS), (tick, received, tx_status))


@pytest.mark.parametrize(
    ("name", "array"),
    [
        *(("received_numbers", numbers(receiver=receiver)) for receiver in ([ROW, ROW, 5], [3, ROW, ROW])),
        *(("received_numbers", numbers(sender_index=index)) for index in ([0, 2, 1], [-1, 1, 1])),
        *(("received_numbers", numbers(payload=payload)) for payload in ([0, 0, 2], [0, -1, 1])),
        *(("received_numbers", numbers()[:4]), ("received_numbers", numbers().astype(np.float64))),
        *(("received_given", np.zeros(shape)) for shape in ((2, 2), (1, 3))),
        ("received_data", np.zeros(3)),
        *(("received_offset", np.array(offset, np.int64)) for offset in ([], [1, 3, 3], [0, 3, 2], [0, 4, 3])),
        *(("tx_status", np.array([rows, [0, 5], [1, 0]])) for rows in ([ROW, 3], [ROW, 5])),
    ],
    ids=repr,
)
def test_bridged_frame_with_contradicting_tables_is_refused(name: str, array: Any) -> None:
    with refused_frame():
        decode_bridged(changed(**{name: array}), TERMS)


def test_bridged_frame_of_another_kind_or_tick_is_refused() -> None:
    frame = frames.decode(encode_bridged(3, ROW, RECEIVED, STATUSES))
    for kind, tick in (("packets", 3), ("tick", -1)):
        with pytest.raises(BadFrame, match="expected a tick"):
            decode_bridged(frames.encode(kind, tick, frame.arrays), TERMS)


def test_bridged_frame_is_limited_to_a_megabyte() -> None:
    def frame_with(count: int) -> bytes:
        """A frame whose last payload has so many bytes."""
        return encode_bridged(3, ROW, replace(RECEIVED, payloads=Payloads.from_rows([b"", bytes(count)])), STATUSES)

    assert MAX_RADIO_FRAME_BYTES == 2**20
    assert len(frame_with(0)) < 2**10
    most = MAX_RADIO_FRAME_BYTES - len(frame_with(2**17)) + 2**17
    fits = frame_with(most)
    assert len(fits) == MAX_RADIO_FRAME_BYTES
    assert decode_bridged(fits, TERMS)[0] == 3
    with pytest.raises(BadFrame, match="oversized"):
        decode_bridged(frame_with(most + 1), TERMS)


@pytest.mark.parametrize("tick", [2**62 // 10**8 + 1, 2**63, 2**64 - 1])
def test_bridged_frame_with_an_impossible_tick_is_refused(tick: int) -> None:
    with pytest.raises(BadFrame):
        decode_bridged(encode_bridged(tick, ROW, RECEIVED, STATUSES), TERMS)


TOLD_TERMS = BridgeInfo(4, ("flock-0", "flock-1"), 10, 100, ("range_m",), ("radio.range", "radio.tx_status"))
GOOD = msgpack.unpackb(TOLD_TERMS.encode())


@pytest.mark.parametrize(
    "value",
    [
        *({**GOOD, "row": value} for value in (-1, "4", True)),
        *({**GOOD, "robots": value} for value in ("flock-0", [1])),
        *({**GOOD, **change} for change in ({"rate_hz": 0}, {"max_payload_bytes": 1.5}, {"measures": None})),
        *({**GOOD, **change} for change in ({"needs": {}}, {"more": 1})),
        *(None, 3, [], ["v"], {1: 2}),
    ],
)
def test_bridge_info_of_another_type_is_malformed(value):
    assert BridgeInfo.decode(TOLD_TERMS.encode()) == TOLD_TERMS
    with refused_frame():
        BridgeInfo.decode(msgpack.packb(value))


@pytest.mark.parametrize("version", [0, 2, "1", True, None])
def test_bridge_info_of_another_version_is_refused(version):
    with refused_frame("version"):
        BridgeInfo.decode(msgpack.packb({**GOOD, "v": version}))


@pytest.mark.parametrize("name", sorted(GOOD))
def test_bridge_info_with_a_missing_key_is_refused(name):
    values = {key: value for key, value in GOOD.items() if key != name}
    with refused_frame("version" if name == "v" else "malformed"):
        BridgeInfo.decode(msgpack.packb(values))


@given(st.binary(max_size=60))
def test_bridge_info_of_garbage_is_refused(data):
    with pytest.raises(BadFrame, match="malformed|version"):  # an empty map names no version
        BridgeInfo.decode(data)


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@given(st.builds(Pose, NUMBERS, NUMBERS, NUMBERS), st.integers(-(2**63), 2**63 - 1))
def test_pose_survives_encoding_with_its_time(pose: Pose, utc_ns: int) -> None:
    assert decode_pose(encode_pose(pose, utc_ns)) == (pose, utc_ns)


@given(st.binary(max_size=100).filter(lambda data: len(data) != POSE_BYTES))
def test_pose_of_another_length_is_refused(data: bytes) -> None:
    with pytest.raises(BadFrame):
        decode_pose(data)


@pytest.mark.parametrize("index", range(3))
@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_pose_that_is_not_finite_is_refused(index: int, wrong: float) -> None:
    numbers = [0.0, 0.0, 0.0]
    numbers[index] = wrong
    with pytest.raises(BadFrame):
        decode_pose(encode_pose(Pose(*numbers), 0))


ROWS = np.array([5, 2])  # group after group: they need not rise
SENT = SentPackets(
    np.array([2, 5, 2]), np.array([BROADCAST, 0, 1]), Payloads.from_rows([b"abc", b"", b"d"]), np.array([-1, 0, 7])
)


def test_packets_frame_survives_encoding() -> None:
    tx_status = TxStatuses(np.array([2, 5]), np.array([0, 3]), np.array([1, 0]))
    for received in (received_from(SENT, [2, 5]), ReceivedPackets.none(MEASURES)):
        frame = frames.decode(encode_packets(7, 712_000_000, 3, received, tx_status))
        assert (frame.kind, frame.tick) == ("packets", 7)
        assert equal(decode_packets(frame, MEASURES), (712_000_000, 3, received, tx_status))


@pytest.mark.parametrize("values", [{}, {"at_ns": 1}, {"at_ns": 1.0, "number": 0}, {"at_ns": 1, "number": "0"}])
def test_packets_frame_without_time_or_number_is_refused(values: dict[str, Any]) -> None:
    with pytest.raises(BadFrame):
        decode_packets(frames.Frame("packets", 0, {}, values), MEASURES)


def test_packets_frame_with_a_missing_table_is_refused() -> None:
    frame = frames.decode(encode_packets(0, 0, 0, received_from(SENT, [2]), NO_TX_STATUSES))
    for name in ("received/given", "received/data", "received/offset"):
        arrays = {key: array for key, array in frame.arrays.items() if key != name}
        with pytest.raises(BadFrame):
            decode_packets(frames.Frame("packets", 0, arrays, frame.values), MEASURES)


def test_sent_frame_survives_with_the_missed_count() -> None:
    for missed, values in ((0, {}), (4, {"missed": 4})):
        frame = frames.decode(encode_sent(7, SENT, missed))
        assert (frame.kind, frame.tick, frame.values) == ("sent", 7, values)
        assert equal(decode_sent(frame, ROWS), SENT)


def test_sent_frame_of_other_robots_or_none_is_refused() -> None:
    none = np.empty(0, np.int64)
    for data, rows in (
        (encode_sent(7, SENT), [2, 4]),
        (encode_sent(7, SENT), none),
        (frames.encode("sent", 7, {}), ROWS),
    ):
        with refused_frame():
            decode_sent(frames.decode(data), np.array(rows))
