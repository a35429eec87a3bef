"""What a tick carries across the wire comes over whole, and a runner speaks for its own robots only."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.sentinels import BROADCAST, NO_TX_STATUS
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxResult, TxStatuses
from swarmwire.comms.robot.tick_io import TABLES, Actions, GroupReadings, Readings, SparseTable
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.tick_frames import check_rows, decode_actions, decode_tick, encode_actions, encode_tick
from tests.support.comms.equality import equal
from tests.support.refusals import refused_frame

I64 = np.iinfo(np.int64)
ROWS = np.array([4, 6, 9])
payload_lists = st.lists(st.binary(max_size=6), min_size=1, max_size=5)


def ints(n: int) -> st.SearchStrategy[IntArray]:
    return npst.arrays(np.int64, n)


def floats(*shape: int) -> st.SearchStrategy[Any]:
    return npst.arrays(np.float64, shape)


@st.composite
def readings_(draw: st.DrawFn) -> Readings:
    out: Readings = {}
    for name in draw(st.lists(st.sampled_from(["flock", "a-b", "x_1"]), unique=True, max_size=3)):
        n = draw(st.integers(0, 4))
        fields = {"compass.heading_rad": draw(floats(n)), "proximity.value": draw(floats(n, 8))}
        out[name] = GroupReadings(np.sort(draw(ints(n))), fields)
    return out


@st.composite
def received_(draw: st.DrawFn, measures: tuple[str, ...]) -> ReceivedPackets:
    payloads = draw(payload_lists)
    k = draw(st.integers(0, 5))
    which = draw(st.lists(st.integers(0, len(payloads) - 1), min_size=k, max_size=k))
    given_columns = {name: draw(floats(k)) for name in measures}
    columns = [np.sort(draw(ints(k))), *(draw(ints(k)) for _ in range(3))]
    return ReceivedPackets(
        *columns, given_columns, np.array(which, np.int64), Payloads.from_rows(payloads if k else [])
    )


@given(readings_(), st.sampled_from([(), ("range_m",), ("range_m", "bearing_rad")]), st.data())
def test_tick_frame_survives_with_readings_and_packets(
    readings: Readings, measures: tuple[str, ...], data: st.DataObject
) -> None:
    assume(readings)
    received = data.draw(received_(measures))
    frame = frames.decode(encode_tick(5, readings, received, NO_TX_STATUSES))
    assert "tx_status" not in frame.arrays
    assert equal(decode_tick(frame, measures, readings.keys()), (readings, received, NO_TX_STATUSES))


TWO_RECEIVED = ReceivedPackets(
    *(np.array(column, np.int64) for column in ([4, 5], [0, 1], [0, 0], [9, 9])),
    {"range_m": np.array([0.5, 1.5])},
    np.array([0, 1], np.int64),
    Payloads.from_rows([b"abc", b"de"]),
)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("received/numbers", np.array([[5, 4], [0, 1], [0, 0], [9, 9], [0, 1]])),  # receivers fall
        ("received/numbers", np.array([[4, 5], [0, 1], [0, 0], [9, 9], [0, 2]])),  # there is no third payload
        ("received/numbers", np.array([[4, 5], [0, 1], [0, 0], [9, 9], [-1, 1]])),
        ("received/numbers", np.array([[4, 5], [0, 1], [0, 0], [9, 9]])),
        ("received/numbers", np.zeros((5, 2))),
        ("received/given", np.array([[0.5]])),
        ("received/given", np.zeros((1, 2), np.int64)),
        ("received/data", np.zeros(4, np.uint8)),
        ("received/offset", np.array([0, 6, 5])),
        ("received/offset", np.array([1, 3, 5])),
        ("received/offset", np.array([0.0, 3.0, 5.0])),
        ("received/offset", np.array([], np.int64)),
    ],
    ids=repr,
)
def test_tick_frame_with_contradicting_packets_is_refused(name: str, wrong: Any) -> None:
    frame = frames.decode(encode_tick(5, {"flock": GroupReadings(ROWS, {})}, TWO_RECEIVED, NO_TX_STATUSES))
    decode_tick(frame, ("range_m",), {"flock"})
    with refused_frame():
        decode_tick(replace(frame, arrays={**frame.arrays, name: wrong}), ("range_m",), {"flock"})


@pytest.mark.parametrize(
    ("rows", "column", "receiver"),
    [
        ([5, 4], [0.0, 0.0], [4, 5]),
        ([4, 4], [0.0, 0.0], [4, 5]),
        ([4, 7], [0.0, 0.0], [4, 5]),
        ([4, 5], [0.0], [4, 5]),
        ([4, 5], [0, 0], [4, 5]),
        ([4, 5], [0.0, 0.0], [-1, 5]),
        ([4, 5], [0.0, 0.0], [4, 2**62]),  # a table of all robots up to this one would not fit anywhere
    ],
)
def test_tick_frame_rows_of_other_robots_are_refused(rows: list[int], column: list[float], receiver: list[int]) -> None:
    expected = {"flock": np.array([4, 5, 6])}

    def checked(rows: list[int], column: list[float], receiver: list[int]) -> None:
        readings = {"flock": GroupReadings(np.array(rows), {"compass.heading_rad": np.array(column)})}
        check_rows(readings, replace(TWO_RECEIVED, receiver=np.array(receiver)), expected)

    checked([4, 5], [0.0, 0.0], [4, 5])
    with refused_frame():
        checked(rows, column, receiver)


def telling(tx_status: TxStatuses) -> frames.Frame:
    return frames.decode(encode_tick(5, {"flock": GroupReadings(ROWS, {})}, ReceivedPackets.none(), tx_status))


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, I64.max), st.sampled_from(TxResult)), min_size=1))
def test_tick_frame_survives_with_tx_status(listed: list[tuple[int, int, int]]) -> None:
    tx_status = TxStatuses(*np.array(listed, np.int64).T)
    assert equal(decode_tick(telling(tx_status), (), {"flock"})[2], tx_status)


def test_tick_frame_of_other_groups_is_refused() -> None:
    for readings, expected in (({"flock": GroupReadings(ROWS, {})}, {"scouts"}), ({}, {"flock"})):
        frame = frames.decode(encode_tick(5, readings, ReceivedPackets.none(), NO_TX_STATUSES))
        with pytest.raises(BadFrame, match="expected groups of this runner"):
            decode_tick(frame, (), expected)


@pytest.mark.parametrize("measures", [(), ("range_m", "bearing_rad")])
def test_tick_frame_with_other_measures_is_refused(measures: tuple[str, ...]) -> None:
    received = ReceivedPackets(
        *np.zeros((4, 1), np.int64), {"range_m": np.zeros(1)}, np.zeros(1, np.int64), Payloads.from_rows([b"a"])
    )
    frame = frames.decode(encode_tick(5, {"flock": GroupReadings(ROWS, {})}, received, NO_TX_STATUSES))
    with pytest.raises(BadFrame):
        decode_tick(frame, measures, {"flock"})


@pytest.mark.parametrize(
    "wrong",
    [
        np.array([[4], [0], [len(TxResult)]]),
        np.array([[4], [0], [-1]]),
        np.array([[4], [0]]),
        np.array([4, 0, 0]),
        np.array([[4.0], [0.0], [0.0]]),
    ],
    ids=repr,
)
def test_tick_frame_with_invalid_tx_status_is_refused(wrong: Any) -> None:
    frame = telling(NO_TX_STATUSES)
    with pytest.raises(BadFrame, match="from 0 to 4$|tx_status: expected <i8") as caught:
        decode_tick(replace(frame, arrays={**frame.arrays, "tx_status": wrong}), (), {"flock"})
    assert caught.value.fault == "malformed"


@given(payload_lists, st.data())
def test_actions_frame_survives_encoding(payloads: list[bytes], data: st.DataObject) -> None:
    k = len(payloads)
    sender = np.array(data.draw(st.lists(st.sampled_from(ROWS.tolist()), min_size=k, max_size=k)), np.int64)
    to = np.array(data.draw(st.lists(st.integers(BROADCAST, I64.max), min_size=k, max_size=k)), np.int64)
    drawn_ids = data.draw(npst.arrays(np.int64, k, elements=st.integers(NO_TX_STATUS, I64.max)))
    ids = data.draw(st.sampled_from([None, np.where(to == BROADCAST, NO_TX_STATUS, drawn_ids)]))
    sent = SentPackets(sender, to, Payloads.from_rows(payloads), ids)
    actions = Actions(ROWS, data.draw(npst.arrays(np.bool_, 3)), *(data.draw(floats(3)) for _ in range(3)), sent)
    frame = frames.decode(encode_actions(8, actions))
    assert (frame.kind, frame.tick) == ("actions", 8)
    assert equal(decode_actions(frame, ROWS), actions)


def sound(**more: Any) -> Actions:
    sent = SentPackets(np.array([4, 9, 9]), np.array([BROADCAST, 0, 2]), Payloads.from_rows([b"ab", b"", b"cde"]))
    return replace(Actions(ROWS, np.array([True, False, True]), np.ones(3), np.zeros(3), np.zeros(3), sent), **more)


ACTUATED = SparseTable(np.array([4, 4, 9]), np.array([0, 3, 1]), np.array([0.5, -2.0, 1e300]))
MOTORS = SparseTable(np.array([4, 9]), np.array([0, 0]), np.array([1.0, 0.0]))
LEDS = SparseTable(np.array([9, 4, 9]), np.array([0, 12, 7]), np.array([float(0xFFFFFF), 0.0, float(0x123456)]))


def refuse(**changes: Any) -> None:
    frame = frames.decode(encode_actions(0, sound(actuators=ACTUATED, leds=LEDS, motors=MOTORS)))
    with refused_frame():
        decode_actions(replace(frame, arrays={**frame.arrays, **changes}), ROWS)


PLACED = SparseTable(np.array([2, 2, 7, 7]), np.array([0, 1, 0, 3]), np.array([0.5, -2.0, 1.0, 3.0]))


def test_poses_survive_in_a_recorded_frame_also_of_robots_that_did_not_act() -> None:
    frame = frames.decode(encode_actions(0, sound(poses=PLACED)))
    assert equal(decode_actions(frame, ROWS, placed=np.arange(10)).poses, PLACED)


@pytest.mark.parametrize(
    ("table", "placed"),
    [(PLACED, None), (PLACED, np.arange(7)), (replace(PLACED, slot=np.array([0, 1, 2, 4])), np.arange(10))],
    ids=["from agents", "of no robot", "in no slot"],
)
def test_poses_are_refused_from_agents_of_unknown_robots_and_in_unknown_slots(table: Any, placed: Any) -> None:
    frame = frames.decode(encode_actions(0, sound(poses=table)))
    with refused_frame():
        decode_actions(frame, ROWS, placed)


def test_actions_frame_survives_with_sparse_tables_and_omits_empty_ones() -> None:
    done = sound(actuators=ACTUATED, leds=LEDS, motors=MOTORS)
    assert equal(decode_actions(frames.decode(encode_actions(0, done)), ROWS), done)
    silent = frames.decode(encode_actions(0, sound(sent=SentPackets.none())))
    assert not [name for name in silent.arrays if name.startswith(("sent", *TABLES))]
    assert (len(decode_actions(silent, ROWS).sent), len(decode_actions(silent, ROWS).actuators)) == (0, 0)


def test_actions_frame_counts_dropped_frames() -> None:
    assert frames.decode(encode_actions(0, sound())).values == {}
    assert frames.decode(encode_actions(0, sound(), 3)).values == {"dropped": 3}


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        *(("rows", rows) for rows in ([4, 6, 8], [6, 4, 9], [4, 6], [4, 6, 9, 9], np.empty(0, np.int64), [0, 0, 0])),
        ("sent/offset", [0, 3, 2, 5]),  # falls
        ("sent/offset", [0, 2, 2, 4]),  # leaves bytes over
        ("sent/offset", [0, 2, 2, 6]),  # leaves the data
        ("sent/offset", [1, 2, 2, 5]),
        ("sent/offset", [0, -1, 2, 5]),
        ("sent/offset", [-1, 2, 2, 5]),
        ("sent/offset", [0, 6, 6, 5]),
        ("sent/offset", [0, I64.max, I64.min, 5]),  # the differences wrap around to positive numbers
        ("sent/offset", [0, I64.min, I64.max, 5]),
        ("sent/offset", [0, I64.max, I64.max, 5]),
        ("sent/offset", [0, 2, 2, I64.max]),
        *(("sent", [sender, [0, 0, 0]]) for sender in ([4, 9, 5], [4, 9, -1], [I64.max, 9, 9], [0, 1, 2])),
        *(("sent", [[4, 9, 9], [0, to, 0]]) for to in (-2, I64.min)),
        *(("sent/tx_status_id", ids) for ids in ([0, 1, 2], [-1, -2, 0], [-1, I64.min, 0], [-1, 1], [[-1, 1, 2]])),
        ("sent/tx_status_id", [-1.0, 1.0, 2.0]),
        *((table, [[4, 4, 8], [0, 3, 1]]) for table in ("leds", "actuators")),  # another's robot
        *((table, [[4, 4, 9], [0, -1, 1]]) for table in ("leds", "actuators")),
        *((table, [[4, 9], [0, 1]]) for table in ("leds", "actuators")),
        *((table, [4, 4, 9]) for table in ("leds", "actuators")),
        *((table, [[4.0, 4.0, 9.0], [0.0, 3.0, 1.0]]) for table in ("leds", "actuators")),
        *(("actuators/value", value) for value in ([0.5, np.nan, 1.0], [0.5, np.inf, 1.0], [1, 2, 3])),
        *(("leds/value", [0.0, rgb, 1.0]) for rgb in (-1.0, float(0x1000000), 0.5, np.nan)),
        *(("motors/value", [switch, 0.0]) for switch in (-1.0, 2.0, 0.5)),
    ],
    ids=repr,
)
def test_actions_frame_that_contradicts_itself_is_refused(name: str, wrong: Any) -> None:
    refuse(**{name: np.array(wrong)})


@pytest.mark.parametrize("name", ["rows", "command", "sent", "sent/offset"])
def test_actions_frame_column_of_another_shape_or_dtype_is_refused(name: str) -> None:
    column = frames.decode(encode_actions(0, sound())).arrays[name]
    longer = np.concatenate([column, column], -1)
    for wrong in (column[..., :-1], longer, column[..., None], column[..., :0], np.zeros((), column.dtype)):
        refuse(**{name: wrong})
    for code in {"<f8", "<i8", "<u8", "|b1", "|u1"} - {column.dtype.str}:
        refuse(**{name: column.astype(code)})


@pytest.mark.parametrize("name", ["rows", "command", "sent/offset", "sent/data"])
def test_actions_frame_with_a_missing_column_is_refused(name: str) -> None:
    frame = frames.decode(encode_actions(0, sound()))
    others = {key: array for key, array in frame.arrays.items() if key != name}
    with pytest.raises(BadFrame):
        decode_actions(replace(frame, arrays=others), ROWS)


def test_actions_frame_of_empty_sent_tables_has_no_packets() -> None:
    frame = frames.decode(encode_actions(0, sound()))
    empty = {"sent": np.empty((2, 0), np.int64), "sent/offset": np.zeros(1, np.int64)}
    arrays = {**frame.arrays, **empty, "sent/data": np.empty(0, np.uint8)}
    assert len(decode_actions(replace(frame, arrays=arrays), ROWS).sent) == 0


def noting(rows: list[int], code: list[float], names: tuple[Any, ...]) -> bytes:
    notes = SparseTable(np.array(rows), np.zeros_like(rows), np.array(code, float), names)
    return encode_actions(0, sound(notes=notes))


def numbering(rows: list[int], value: list[float]) -> bytes:
    values = SparseTable(np.array(rows, np.int64), np.zeros(len(rows), np.int64), np.array(value))
    return encode_actions(0, sound(values=values))


def test_actions_frame_survives_with_states_and_values() -> None:
    notes = decode_actions(frames.decode(noting([9, 4], [1, 0], ("search", "wait"))), ROWS).notes
    assert (notes.rows.tolist(), notes.integers.tolist(), notes.names) == ([9, 4], [1, 0], ("search", "wait"))
    value = [0.1 + 0.2, -0.0, 5e-324]
    values = decode_actions(frames.decode(numbering([9, 4, 4], value)), ROWS).values
    assert (values.rows.tolist(), values.value.tobytes()) == ([9, 4, 4], np.array(value).tobytes())
    assert numbering([], []) == encode_actions(0, sound())
    assert len(decode_actions(frames.decode(numbering([], [])), ROWS).values) == 0


@pytest.mark.parametrize(
    "data",
    [
        noting([5], [0], ("search",)),  # another's robot
        noting([4, 4], [0, 0], ("search",)),
        noting([4], [1], ("search",)),
        noting([4], [-1], ("search",)),
        noting([4], [0.5], ("search", "wait")),
        *(noting([4], [0], names) for names in ((), ("",), ("x" * 65,), (7,), tuple(map(str, range(257))))),
        numbering([5], [1.0]),
        numbering([4], [np.nan]),
        numbering([4], [np.inf]),
        numbering([4, 9], [1.0]),
        numbering([4], []),
    ],
    ids=range(15),
)
def test_actions_frame_with_invalid_states_or_values_is_refused(data: bytes) -> None:
    with refused_frame():
        decode_actions(frames.decode(data), ROWS)
