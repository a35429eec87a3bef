"""What the air tells a driver-run robot comes over whole, and is refused where its tables contradict one another."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.outcomes import NO_OUTCOMES, Outcomes
from swarmwire.comms.packets import Heard, Payloads
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.air_frames import MOST_BYTES, decode_air, encode_air
from swarmwire.comms.wire.air_terms import AirTerms

ROW = 4  # of the robot, in the world; in its arena there are two
TERMS = AirTerms(ROW, ("a", "b"), 10, 100, ("range_m", "bearing_rad"), ())
# From both robots of the arena; the first message was heard twice, and the last is empty.
HEARD = Heard(
    receiver=np.array([ROW, ROW, ROW]),
    sender=np.array([0, 1, 1]),
    sequence=np.array([7, 0, 1]),
    heard_at_ns=np.array([10, 20, 30]),
    given={"range_m": np.array([0.5, 1.0, 1.5]), "bearing_rad": np.array([-1.0, 0.0, 1.0])},
    payload=np.array([0, 0, 1]),
    payloads=Payloads.of([b"abc", b""]),
)
OUTCOMES = Outcomes(np.array([ROW, ROW]), np.array([0, 5]), np.array([1, 0]))


def changed(**arrays: Any) -> bytes:
    """A sound frame but for these arrays, "_" for "/"."""
    whole = frames.decode(encode_air(3, ROW, HEARD, OUTCOMES))
    wrong = {name.replace("_", "/"): array for name, array in arrays.items()}
    return frames.encode(whole.kind, whole.tick, {**whole.arrays, **wrong})


def numbers(**columns: list[int]) -> np.ndarray[Any, Any]:
    """The table of what was heard, with these columns in place of its own."""
    heard = replace(HEARD, **{name: np.array(column) for name, column in columns.items()})
    return np.array((heard.receiver, heard.sender, heard.sequence, heard.heard_at_ns, heard.payload))


def test_what_was_heard_and_learned_comes_over_whole() -> None:
    tick, heard, outcomes = decode_air(encode_air(3, ROW, HEARD, OUTCOMES), TERMS)
    assert tick == 3
    for name in ("receiver", "sender", "sequence", "heard_at_ns", "payload"):
        assert getattr(heard, name).tolist() == getattr(HEARD, name).tolist()
    assert {name: column.tolist() for name, column in heard.given.items()} == {
        "range_m": [0.5, 1.0, 1.5],
        "bearing_rad": [-1.0, 0.0, 1.0],
    }
    assert [heard.payloads.row(at) for at in range(2)] == [b"abc", b""]
    assert (outcomes.row.tolist(), outcomes.id.tolist(), outcomes.result.tolist()) == ([ROW, ROW], [0, 5], [1, 0])


def test_the_first_tick_of_a_robot_that_hears_nothing_comes_over() -> None:
    tick, heard, outcomes = decode_air(encode_air(0, ROW, Heard.none(TERMS.gives), NO_OUTCOMES), TERMS)
    assert (tick, len(heard), len(outcomes)) == (0, 0, 0)
    assert set(heard.given) == set(TERMS.gives)


@pytest.mark.parametrize(
    ("arrays", "told"),
    [
        ({"heard_numbers": numbers(receiver=[ROW, ROW, 5])}, "to itself"),
        ({"heard_numbers": numbers(receiver=[3, ROW, ROW])}, "to itself"),
        ({"heard_numbers": numbers(sender=[0, 2, 1])}, "to itself"),
        ({"heard_numbers": numbers(sender=[-1, 1, 1])}, "to itself"),
        ({"heard_numbers": numbers(payload=[0, 0, 2])}, "payloads that are there"),
        ({"heard_numbers": numbers(payload=[0, -1, 1])}, "payloads that are there"),
        ({"heard_numbers": numbers()[:4]}, "heard/numbers"),
        ({"heard_numbers": numbers().astype(np.float64)}, "heard/numbers"),
        ({"heard_given": np.zeros((2, 2))}, "heard/given"),
        ({"heard_given": np.zeros((1, 3))}, "heard/given"),
        ({"heard_data": np.zeros(3)}, "heard/data"),
        ({"heard_offset": np.array([], np.int64)}, "heard/offset"),
        ({"heard_offset": np.array([1, 3, 3])}, "heard/offset"),
        ({"heard_offset": np.array([0, 3, 2])}, "heard/offset"),
        ({"heard_offset": np.array([0, 4, 3])}, "heard/offset"),
        ({"outcomes": np.array([[ROW, 3], [0, 5], [1, 0]])}, "robot's own"),
        ({"outcomes": np.array([[ROW, 5], [0, 5], [1, 0]])}, "robot's own"),
    ],
    ids=str,
)
def test_tables_that_contradict_one_another_are_refused(arrays: dict[str, Any], told: str) -> None:
    with pytest.raises(BadFrame, match=told) as caught:
        decode_air(changed(**arrays), TERMS)
    assert caught.value.fault == "malformed"


def test_other_kinds_and_ticks_before_the_first_are_refused() -> None:
    whole = frames.decode(encode_air(3, ROW, HEARD, OUTCOMES))
    for kind, tick in (("packets", 3), ("tick", -1)):
        with pytest.raises(BadFrame, match="expected a tick"):
            decode_air(frames.encode(kind, tick, whole.arrays), TERMS)


def test_a_frame_may_have_a_megabyte_and_no_more() -> None:
    sizes = [
        len(encode_air(3, ROW, replace(HEARD, payloads=Payloads.of([b"", bytes(n)])), OUTCOMES)) for n in (0, 2**17)
    ]
    most = MOST_BYTES - sizes[1] + 2**17
    assert sizes[0] < 2**10
    assert MOST_BYTES == 2**20
    fits, exceeds = (
        encode_air(3, ROW, replace(HEARD, payloads=Payloads.of([b"", bytes(n)])), OUTCOMES) for n in (most, most + 1)
    )
    assert len(fits) == MOST_BYTES
    assert decode_air(fits, TERMS)[0] == 3
    with pytest.raises(BadFrame, match="oversized"):
        decode_air(exceeds, TERMS)


@pytest.mark.parametrize("tick", [2**62 // 10**8 + 1, 2**63, 2**64 - 1])
def test_a_tick_that_no_run_has_is_refused(tick: int) -> None:
    with pytest.raises(BadFrame):
        decode_air(encode_air(tick, ROW, HEARD, OUTCOMES), TERMS)
