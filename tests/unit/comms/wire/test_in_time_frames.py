"""Frames between ticks: what is packed comes back, and nothing else is taken."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.outcomes import NO_OUTCOMES, Outcomes
from swarmwire.comms.packets import BROADCAST, Heard, Payloads, Sent
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.in_time_frames import decode_packets, decode_sent, encode_packets, encode_sent
from tests.support.agent.hosts import GIVES, heard_from

ROWS = np.array([5, 2])  # group after group: they need not rise
SENT = Sent(np.array([2, 5, 2]), np.array([BROADCAST, 0, 1]), Payloads.of([b"abc", b"", b"d"]), np.array([-1, 0, 7]))


def test_packets_and_outcomes_come_back_with_time_and_number() -> None:
    heard, outcomes = heard_from(SENT, [2, 5]), Outcomes(np.array([2, 5]), np.array([0, 3]), np.array([1, 0]))
    frame = frames.decode(encode_packets(7, 712_000_000, 3, heard, outcomes))
    assert (frame.kind, frame.tick) == ("packets", 7)
    at_ns, number, got, told = decode_packets(frame, GIVES)
    assert (at_ns, number) == (712_000_000, 3)
    for name in ("receiver", "sender", "sequence", "heard_at_ns", "payload"):
        assert getattr(got, name).tolist() == getattr(heard, name).tolist()
    assert [got.payloads.row(i) for i in range(3)] == [heard.payloads.row(i) for i in range(3)]
    assert (told.row.tolist(), told.id.tolist(), told.result.tolist()) == ([2, 5], [0, 3], [1, 0])


@pytest.mark.parametrize("values", [{}, {"at_ns": 1}, {"at_ns": 1.0, "number": 0}, {"at_ns": 1, "number": "0"}])
def test_packets_without_time_and_number_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(BadFrame):
        decode_packets(frames.Frame("packets", 0, {}, values), GIVES)


def test_packets_with_a_table_missing_are_refused() -> None:
    whole = frames.decode(encode_packets(0, 0, 0, heard_from(SENT, [2]), NO_OUTCOMES))
    for name in ("heard/given", "heard/data", "heard/offset"):
        arrays = {key: array for key, array in whole.arrays.items() if key != name}
        with pytest.raises(BadFrame):
            decode_packets(frames.Frame("packets", 0, arrays, whole.values), GIVES)


def test_what_was_sent_comes_back_and_says_what_was_missed() -> None:
    for missed, values in ((0, {}), (4, {"missed": 4})):
        frame = frames.decode(encode_sent(7, SENT, missed))
        assert (frame.kind, frame.tick, frame.values) == ("sent", 7, values)
        got = decode_sent(frame, ROWS)
        assert (got.sender.tolist(), got.to.tolist()) == (SENT.sender.tolist(), SENT.to.tolist())
        assert got.outcome_ids.tolist() == [-1, 0, 7]
        assert [got.payloads.row(i) for i in range(3)] == [b"abc", b"", b"d"]


def test_packets_of_robots_that_are_not_the_runners_own_are_refused_and_so_are_none() -> None:
    for data, rows in ((encode_sent(7, SENT), np.array([2, 4])), (frames.encode("sent", 7, {}), ROWS)):
        with pytest.raises(BadFrame, match="expected packets"):
            decode_sent(frames.decode(data), rows)


def test_nothing_heard_is_a_frame_of_outcomes_alone() -> None:
    outcomes = Outcomes(np.array([2]), np.array([0]), np.array([1]))
    _, _, heard, told = decode_packets(frames.decode(encode_packets(0, 0, 0, Heard.none(GIVES), outcomes)), GIVES)
    assert (len(heard), len(told)) == (0, 1)


def test_a_runner_of_one_robot_or_of_none_speaks_for_no_other() -> None:
    for sender in (4, 6):
        one = frames.decode(encode_sent(7, Sent(np.array([sender]), np.array([0]), Payloads.of([b"a"]))))
        assert decode_sent(one, np.array([sender])).sender.tolist() == [sender]
        assert one.values == {}
        for rows in ([5], []):
            with pytest.raises(BadFrame, match="expected packets of the runner's own robots"):
                decode_sent(one, np.array(rows, np.int64))
