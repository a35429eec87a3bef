"""Payload tables taken, joined and sorted without loss; fates keep their numbers; a state is a short text."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import (
    FATE_NAMES,
    NO_TX_STATUSES,
    TAG_BYTES,
    Fate,
    Payloads,
    ReceivedPackets,
    SentPackets,
    TxStatuses,
)
from swarmwire.comms.robot.tick_io import Actions, checked_state

ragged = st.lists(st.binary(max_size=5), max_size=6)


def listed(payloads: Payloads) -> list[bytes]:
    return [payloads.row(i) for i in range(len(payloads))]


@given(ragged)
def test_payloads_hold_their_rows(rows: list[bytes]) -> None:
    payloads = Payloads.from_rows(rows)
    assert len(payloads) == len(rows)
    assert listed(payloads) == rows
    assert payloads.sizes.tolist() == [len(row) for row in rows]


@given(ragged, st.data())
def test_payloads_select_rows_in_index_order(rows: list[bytes], data: st.DataObject) -> None:
    index = data.draw(st.lists(st.integers(0, len(rows) - 1), max_size=8)) if rows else []
    assert listed(Payloads.from_rows(rows).select(np.array(index, np.int64))) == [rows[i] for i in index]


@given(st.lists(ragged, max_size=4))
def test_payloads_join_in_order(parts: list[list[bytes]]) -> None:
    joined = Payloads.joined([Payloads.from_rows(rows) for rows in parts])
    assert listed(joined) == [row for rows in parts for row in rows]


@given(ragged)
def test_tag_is_the_first_two_bytes_of_a_row(rows: list[bytes]) -> None:
    expected = [int.from_bytes(row[:TAG_BYTES], "little") if len(row) >= TAG_BYTES else -1 for row in rows]
    assert Payloads.from_rows(rows).tags().tolist() == expected


def test_payload_offsets_are_int64_in_every_table() -> None:
    tables = [
        Payloads.from_rows([]),
        Payloads.joined([]),
        Payloads.from_rows([b"abc"]),
        Payloads.from_rows([b""]).select(np.array([0, 0])),
    ]
    assert all(table.offset.dtype == np.int64 and table.data.dtype == np.uint8 for table in tables)
    assert listed(tables[-1]) == [b"", b""]


def test_tx_status_ids_follow_their_packets_when_joined() -> None:
    silent = SentPackets(np.array([3]), np.array([BROADCAST]), Payloads.from_rows([b"aa"]))
    asking = SentPackets(np.array([1, 1]), np.array([0, 2]), Payloads.from_rows([b"b", b"ccc"]), np.array([4, 5]))
    joined = SentPackets.joined([silent, SentPackets.none(), asking])
    assert joined.tx_status_ids.tolist() == [-1, 4, 5]
    picked = joined.select(np.array([2, 0]))
    assert (picked.sender.tolist(), picked.to.tolist(), picked.tx_status_ids.tolist()) == ([1, 3], [2, -1], [5, -1])
    assert listed(picked.payloads) == [b"ccc", b"aa"]
    assert SentPackets.joined([silent, silent]).tx_status_id is None


def test_tx_status_joined_are_sorted_by_robot_and_id() -> None:
    parts = [
        TxStatuses(np.array(row), np.array(id_), np.array(result))
        for row, id_, result in (([2, 0], [7, 9], [1, 0]), ([0, 2], [3, 1], [4, 2]))
    ]
    joined = TxStatuses.joined([*parts, NO_TX_STATUSES])
    assert list(zip(joined.row, joined.id, joined.result, strict=True)) == [(0, 3, 4), (0, 9, 0), (2, 1, 2), (2, 7, 1)]
    assert joined.acknowledged.tolist() == [False, True, False, False]
    assert len(TxStatuses.joined([])) == 0


def test_actions_joined_carry_all_packets() -> None:
    parts = [
        Actions(np.array([row]), np.array([True]), np.array([0.1]), np.array([0.2]), np.array([0.3]), sent)
        for row, sent in (
            (2, SentPackets.none()),
            (0, SentPackets(np.array([0]), np.array([BROADCAST]), Payloads.from_rows([b"xy"]))),
        )
    ]
    joined = Actions.joined(parts)
    assert joined.rows.tolist() == [2, 0]
    assert listed(joined.sent.payloads) == [b"xy"]
    none = Actions.joined([])
    assert (len(none.rows), none.drive.dtype, none.linear_mps.dtype) == (0, np.bool_, np.float64)


def test_received_packets_selected_keep_their_columns_together() -> None:
    received = ReceivedPackets(
        receiver=np.array([0, 1, 1]),
        sender_index=np.array([5, 6, 7]),
        sequence=np.array([0, 1, 2]),
        received_at_ns=np.array([10, 20, 30]),
        measured={"range_m": np.array([0.1, 0.2, 0.3])},
        payload=np.array([1, 0, 1]),
        payloads=Payloads.from_rows([b"aa", b"bb"]),
    )
    chosen = received.select(np.array([2, 0]))
    assert len(chosen) == 2
    assert chosen.sender_index.tolist() == [7, 5]
    assert chosen.measured["range_m"].tolist() == [0.3, 0.1]
    assert [chosen.payloads.row(int(i)) for i in chosen.payload] == [b"bb", b"bb"]
    assert set(ReceivedPackets.none(("range_m",)).measured) == {"range_m"}
    assert len(ReceivedPackets.none()) == 0


def test_fates_have_fixed_numbers() -> None:
    assert " ".join(FATE_NAMES) == (
        "received out_of_range blocked lost queue_full too_large in_flight sender_dead receiver_dead blackout "
        "partitioned too_weak collided burst channel_busy jammed duty_cycle not_listening"
    )
    assert [int(fate) for fate in Fate] == list(range(len(FATE_NAMES)))


@pytest.mark.parametrize("state", ["a", "ä" * 64])
def test_state_accepts_short_texts(state):
    assert checked_state(state) == state


@pytest.mark.parametrize("state", ["", "a" * 65, None, 1, b"a"])
def test_state_of_another_kind_is_refused(state):
    with pytest.raises(ValueError, match=r"^note\(state=…\): expected a text of 1 to 64 characters"):
        checked_state(state)
