"""What hosts remember comes over: another host goes on where the first one was, bit for bit, with a VectorAgent."""

from typing import Any

import numpy as np
import pytest

from swarmwire.agent.agent import load_agent
from swarmwire.agent.host import AgentExecutor, layout_of
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.packets import ReceivedPackets, TxStatuses
from swarmwire.comms.tick_io import Actions
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import GroupMemory, Memory, decode_memory, encode_memory
from tests.support.agent.hosts import MEASURES, assignment, group, one_group, plain, spec

ROWS = [0, 1, 2, 5, 6]
WHOLE = {name: assignment(group(spec(name), ROWS)) for name in ("VectorInsisting", "VectorCounter", "Counter")}


def told(tick: int) -> TxStatuses:
    """What radios tell: of packets of this agent, and of some that an agent before it sent."""
    row = np.array([0, 1, 5, 6], np.int64)
    return TxStatuses(row, np.array([2 * tick, 0, tick, 1], np.int64), np.array([0, 1, 0, 2], np.int64))


def acting(tick: int) -> list[int]:
    """Robots that drop out and come back."""
    return [row for row in ROWS if (row + tick) % 4]


def act(host: AgentExecutor, tick: int) -> Actions:
    return host.act(tick, one_group(tick, acting(tick)), ReceivedPackets.none(MEASURES), told(tick))


def ids(actions: Actions) -> list[int]:
    return [] if actions.sent.tx_status_id is None else actions.sent.tx_status_id.tolist()


def over_the_wire(host: AgentExecutor, name: str) -> Memory:
    layouts = {"flock": layout_of(load_agent(spec(name)))}
    return decode_memory(frames.decode(encode_memory(host.memory(["flock"]))), layouts)


@pytest.mark.parametrize("name", ["VectorInsisting", "VectorCounter"])
@pytest.mark.parametrize("at", range(1, 7))
def test_another_host_goes_on_as_the_first_would_have(name: str, at: int) -> None:
    first = AgentExecutor(WHOLE[name])
    for tick in range(at):
        act(first, tick)
    second = AgentExecutor(WHOLE[name], over_the_wire(first, name))
    for tick in range(at, at + 6):
        got, expected = act(second, tick), act(first, tick)
        assert plain(got) == plain(expected)
        assert ids(got) == ids(expected)


def test_the_memory_of_some_robots_is_theirs_and_the_others_start_afresh() -> None:
    first = AgentExecutor(WHOLE["VectorCounter"])
    for tick in range(4):
        first.act(tick, one_group(tick, ROWS), ReceivedPackets.none(MEASURES))
    kept = {"flock": first.memory(["flock"])["flock"].of(np.array([1, 5]))}
    second = AgentExecutor(WHOLE["VectorCounter"], kept)
    got = second.act(4, one_group(4, ROWS), ReceivedPackets.none(MEASURES))
    assert dict(zip(got.rows.tolist(), got.linear_mps.tolist(), strict=True)) == {
        0: 1.0,
        1: 5.0,
        2: 1.0,
        5: 5.0,
        6: 1.0,
    }


def test_a_robot_that_did_not_act_last_starts_afresh_when_it_does() -> None:
    first = AgentExecutor(WHOLE["VectorCounter"])
    first.act(0, one_group(0, ROWS), ReceivedPackets.none(MEASURES))
    first.act(1, one_group(1, [0, 1]), ReceivedPackets.none(MEASURES))
    got = AgentExecutor(WHOLE["VectorCounter"], first.memory(["flock"])).act(
        2, one_group(2, [1, 2]), ReceivedPackets.none(MEASURES)
    )
    assert got.linear_mps.tolist() == [3.0, 1.0]


def test_an_agent_of_one_robot_starts_afresh() -> None:
    first = AgentExecutor(WHOLE["Counter"])
    for tick in range(4):
        first.act(tick, one_group(tick, ROWS), ReceivedPackets.none(MEASURES))
    second = AgentExecutor(WHOLE["Counter"], over_the_wire(first, "Counter"))
    assert second.act(4, one_group(4, ROWS), ReceivedPackets.none(MEASURES)).linear_mps.tolist() == [1.0] * len(ROWS)


def test_memories_of_parts_join_in_the_order_of_the_robots() -> None:
    whole = GroupMemory(np.arange(6), {"x": np.arange(6) * 0.5, "y": np.arange(12).reshape(6, 2)})
    joined = GroupMemory.joined([whole.of(np.array([1, 3, 5])), whole.of(np.array([0, 2])), whole.of(np.array([4]))])
    assert joined.rows.tolist() == whole.rows.tolist()
    assert all(np.array_equal(joined.columns[name], column) for name, column in whole.columns.items())


LAYOUT = {"g": {"x": ("<f8", ()), "y": ("<i8", (2,))}}
SOUND: dict[str, Any] = {
    "memory/g/rows": np.array([1, 3]),
    "memory/g/x": np.array([0.5, 1.5]),
    "memory/g/y": np.array([[1, 2], [3, 4]]),
}


@pytest.mark.parametrize(
    "changed",
    [
        {"memory/g/x": None},
        {"memory/g/x": np.array([0.5])},
        {"memory/g/x": np.array([1, 2])},
        {"memory/g/y": np.array([1, 2])},
        {"memory/g/y": np.array([[1], [2]])},
        {"memory/g/rows": np.array([3, 1])},
        {"memory/g/rows": np.array([1, 2])},
        {"memory/g/rows": np.array([1.0, 3.0])},
    ],
    ids=repr,
)
def test_memory_that_does_not_fit_is_refused(changed: dict[str, Any]) -> None:
    arrays = {name: array for name, array in {**SOUND, **changed}.items() if array is not None}
    with pytest.raises(BadFrame):
        decode_memory(frames.decode(frames.encode("memory", -1, arrays)), LAYOUT, {"g": np.array([1, 3])})


def test_groups_without_memory_and_groups_that_are_not_known_are_passed_over() -> None:
    frame = frames.decode(frames.encode("memory", -1, SOUND))
    assert decode_memory(frame, {"other": LAYOUT["g"]}) == {}
    assert decode_memory(frame, LAYOUT)["g"].rows.tolist() == [1, 3]


def test_a_frame_of_memory_is_of_no_tick_and_of_exactly_these_robots() -> None:
    whole = {"g": GroupMemory(np.array([1, 3]), {"x": SOUND["memory/g/x"], "y": SOUND["memory/g/y"]})}
    frame = frames.decode(encode_memory(whole))
    assert (frame.kind, frame.tick) == ("memory", -1)
    layouts = {"without": LAYOUT["g"], **LAYOUT}
    got = decode_memory(frame, layouts, {"g": np.array([1, 3])})
    assert (list(got), got["g"].columns["y"].tolist()) == (["g"], [[1, 2], [3, 4]])
    for rows in (
        {"g": np.array([1, 3, 5])},
        {"g": np.array([1])},
        {"g": np.array([1, 5])},
        {"other": np.array([1, 3])},
    ):
        with pytest.raises(BadFrame, match="expected the runner's own robots"):
            decode_memory(frame, LAYOUT, rows)
