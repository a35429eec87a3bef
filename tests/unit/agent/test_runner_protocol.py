"""The runner's side of the protocol: it acts on the newest tick, answers it once, and counts what it drops."""

from collections.abc import Callable
from copy import copy
from typing import Any, cast

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from swarmwire.agent.runner_protocol import (
    MOVES,
    Ended,
    Event,
    JoinOptions,
    Move,
    PacketsBetween,
    PacketsReceived,
    RunnerProtocol,
    RunnerState,
    Tick,
)
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, SentPackets
from swarmwire.comms.robot.tick_io import Actions
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import encode_memory
from swarmwire.comms.wire.join import JoinRequest
from swarmwire.comms.wire.tick_frames import encode_packets, encode_tick
from tests.support.agent.hosts import SILENCE, TIMES, assignment, group, readings, received_from, words
from tests.support.agent.runners import assigned_robots, joining

ASSIGNMENT = assignment(group("unused:Agent", [0]))
REPLY: dict[str, Any] = {**ASSIGNMENT.as_mapping(), "v": frames.VERSION, "memory": None, **TIMES}
COLUMNS = {"flock": {"host.sent": ["<i8", []]}}
END, LEAVE = (frames.encode(kind, -1, {}) for kind in ("end", "leave"))
READY = frames.encode("ready", -1, {}, {"processes": 1})
REMOVED = frames.encode("end", -1, {}, {"why": "no answer for 3 s"})
ZERO = np.zeros(1)
ACTIONS = Actions(np.array([0]), ZERO != 0.0, ZERO, ZERO, ZERO)


def tick(number: int, name: str = "flock", row: int = 0) -> bytes:
    return encode_tick(number, {name: readings(number, [row])}, SILENCE, NO_TX_STATUSES)


def packets(number: int, tick_number: int = 0) -> bytes:
    sent = SentPackets(np.array([1]), np.array([BROADCAST]), Payloads.from_rows([bytes([0, 0, number])]))
    return encode_packets(tick_number, 1_000 * number, number, received_from(sent, [0]), NO_TX_STATUSES)


def playing(*arrived: bytes, reply: dict[str, Any] = REPLY) -> RunnerProtocol:
    """The protocol of a runner whose agents are ready, after these frames."""
    protocol = joining()
    protocol.receive_assignment(msgpack.packb(reply))
    assert protocol.ready() == READY
    receive(protocol, *arrived)
    return protocol


def receive(protocol: RunnerProtocol, *arrived: bytes) -> None:
    for data in arrived:
        protocol.receive_frame(data)


def in_state(state: RunnerState) -> RunnerProtocol:
    if state == "searching":
        return RunnerProtocol()
    if state in ("joining", "joined"):
        protocol = joining()
        if state == "joined":
            protocol.receive_assignment(msgpack.packb(REPLY))
        return protocol
    protocol = playing(tick(0))
    if state == "acting":
        protocol.next_event()
    elif state == "leaving":
        protocol.leave()
    elif state == "ended":
        receive(protocol, END)
    return protocol


def next_tick(protocol: RunnerProtocol) -> int:
    event = protocol.next_event()
    assert isinstance(event, Tick)
    return event.tick


def answer(protocol: RunnerProtocol) -> tuple[int, int]:
    """The tick of the answer, and the count of dropped frames in it."""
    frame = frames.decode(protocol.answer(ACTIONS))
    assert frame.kind == "actions"
    return frame.tick, frame.values.get("dropped", 0)


def content(event: Event | None) -> Any:
    """Of received packets the last byte of each."""
    if not isinstance(event, PacketsReceived):
        return event
    return [event.received.payloads.row(at)[-1] for at in range(len(event.received.payloads))]


def test_waiting_ticks_run_the_newest_and_report_the_others() -> None:
    protocol = playing(tick(0), tick(1), tick(2))
    assert next_tick(protocol) == 2
    assert answer(protocol) == (2, 2)
    strange, of_others = tick(9, "others", 1), tick(9, row=1)
    receive(protocol, tick(2), tick(1), b"\xc1", strange, of_others, tick(3), tick(5), tick(4))
    assert next_tick(protocol) == 5
    assert answer(protocol) == (5, 7)
    receive(protocol, tick(6))
    assert next_tick(protocol) == 6
    assert answer(protocol) == (6, 0)
    receive(protocol, tick(6))
    assert protocol.next_event() is None


def test_tick_that_arrives_before_the_answer_waits_for_it() -> None:
    protocol = playing(tick(0))
    assert next_tick(protocol) == 0
    receive(protocol, tick(1), packets(0, 1))
    assert protocol.next_event() is None
    assert answer(protocol) == (0, 0)
    assert content(protocol.next_event()) == [0]
    assert next_tick(protocol) == 1


def test_ticks_in_which_no_group_acts_are_dropped() -> None:
    group, periods = REPLY["groups"][0], (("a", 0, 4), ("b", 1, 6))
    groups = [{**group, "name": name, "rows": [row], "act_every_ticks": every} for name, row, every in periods]
    protocol = playing(*(tick(number, "a") for number in range(4)), reply={**REPLY, "groups": groups})
    assert next_tick(protocol) == 2
    assert answer(protocol) == (2, 3)


def test_packets_between_ticks_are_ordered_events_until_a_newer_tick() -> None:
    protocol = playing(tick(0))
    assert next_tick(protocol) == 0
    answer(protocol)
    receive(protocol, packets(0), packets(1))
    assert [content(protocol.next_event()) for _ in range(4)] == [[0], [1], PacketsBetween(0, 1_000), None]
    receive(protocol, packets(2), tick(1), packets(3, 1))
    assert [content(protocol.next_event()) for _ in range(2)] == [[2], [3]]
    assert next_tick(protocol) == 1  # with the packets that are there: the step reads all of them
    answer(protocol)
    assert protocol.next_event() is None
    receive(protocol, END)
    assert protocol.next_event() == Ended("over")
    assert (protocol.dropped, protocol.missed) == (0, 0)


def test_lost_packets_frames_are_reported_with_the_next_packets() -> None:
    protocol = playing(packets(2), packets(3), packets(7), frames.encode("packets", 0, {}))
    assert protocol.missed == 2 + 3
    frame = frames.decode(protocol.send(0, words(0)))
    assert (frame.kind, frame.tick, frame.values) == ("sent", 0, {"missed": 5})
    assert frames.decode(protocol.send(0, words(0))).values == {}
    assert protocol.dropped == 1


def test_frames_from_before_the_assignment_are_dropped_and_counted() -> None:
    protocol = RunnerProtocol()
    receive(protocol, tick(0))
    protocol.world_present(True)
    receive(protocol, tick(0), END, b"\xc1")
    protocol.receive_assignment(msgpack.packb(REPLY))
    protocol.ready()
    receive(protocol, tick(0))
    assert next_tick(protocol) == 0
    assert answer(protocol) == (0, 4)


@pytest.mark.parametrize(
    ("data", "ended"), [(END, Ended("over")), (REMOVED, Ended("removed", "no answer for 3 s"))], ids=["over", "removed"]
)
def test_frames_after_the_end_of_the_run_are_ignored(data: bytes, ended: Ended) -> None:
    protocol = playing(tick(0), packets(0), data, tick(1))
    assert protocol.next_event() == ended
    assert (protocol.state, protocol.dropped) == ("ended", 3)


@pytest.mark.parametrize("state", [state for state in MOVES if state != "leaving"])
def test_runner_whose_world_vanishes_has_lost_it(state: RunnerState) -> None:
    protocol = in_state(state)
    protocol.world_present(False)
    assert protocol.next_event() == Ended("over" if state == "ended" else "gone")


@pytest.mark.parametrize("state", MOVES)
def test_runner_with_robots_leaves_by_a_frame_and_waits_for_confirmation(state: RunnerState) -> None:
    protocol = in_state(state)
    with_robots = state in ("joined", "ready", "acting")
    assert protocol.leave() == (LEAVE if with_robots else None)
    if with_robots:
        receive(protocol, tick(8), packets(0), b"\xc1")
        assert protocol.next_event() is None
        receive(protocol, REMOVED)
    assert protocol.next_event() == Ended("over" if state == "ended" else "left")


@pytest.mark.parametrize("confirmation", [lambda protocol: protocol.world_present(False), RunnerProtocol.leave])
def test_runner_that_leaves_ends_without_a_confirmation(confirmation: Callable[[RunnerProtocol], object]) -> None:
    protocol = in_state("leaving")
    confirmation(protocol)
    assert protocol.next_event() == Ended("left")


@pytest.mark.parametrize("state", ["joined", "ready", "acting"])
def test_lost_process_is_a_frame_and_the_others_continue(state: RunnerState) -> None:
    protocol = in_state(state)
    rows = np.array([4, 7])
    frame = frames.decode(protocol.lose(rows, "3", "no answer"))
    assert (frame.kind, frame.tick, frame.arrays["rows"].tolist()) == ("lost", -1, [4, 7])
    assert frame.values == {"process": "3", "reason": "no answer"}
    frame = frames.decode(protocol.lose(rows, "3", "its agent failed", "flock-7", "Traceback …"))
    agent = {"robots": "flock-7", "traceback": "Traceback …"}
    assert frame.values == {"process": "3", "reason": "its agent failed", **agent}
    assert protocol.state == state


def test_request_names_the_robots_and_replaces_the_worlds_agents() -> None:
    protocol = joining()
    request = JoinRequest(robots=3, agents={"flock": "0" * 64})
    assert JoinRequest.decode(protocol.join(JoinOptions(request, {"flock": "mine:Agent"}))) == request
    assigned = protocol.receive_assignment(msgpack.packb(REPLY))
    assert [robots.agent for robots in assigned.assignment.groups] == ["mine:Agent"]
    assert assigned.memory is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"groups": None},
        {"groups": []},
        {"groups": [3]},
        {"rate_hz": 0},
        {"measures": [1]},
        {"memory": "text"},
        {"memory": b"\xc1", "memory_columns": COLUMNS},
        {"memory": encode_memory({})},
        {"memory": encode_memory({}), "memory_columns": {}},
        {"memory": encode_memory({}), "memory_columns": {"flock": {"sent": ["<O", []]}}},
        {"v": frames.VERSION - 1},
        *({"groups": [{**REPLY["groups"][0], **changes}]} for changes in (
            {"rows": [[1, 2]]}, {"rows": [-1]}, {"rows": [2**63]}, {"rows": ["x"]}, {"robot_names": []},
            {"keys": [1, 2]}, {"keys": [-1]}, {"params": []}, {"body": {}}, {"act_every_ticks": 0}, {"agent": 3},
        )),
    ],
    ids=repr,
)  # fmt: skip
def test_reply_that_assigns_no_robots_is_refused_without_a_change(wrong: dict[str, Any]) -> None:
    assert assigned_robots(msgpack.packb(REPLY)).assignment.robot_names == ("flock-0",)
    protocol = joining()
    with pytest.raises(BadFrame):
        protocol.receive_assignment(msgpack.packb({**REPLY, **wrong}))
    assert protocol.state == "joining"


@given(st.lists(st.integers(0, 3), min_size=1, max_size=8))
def test_lockstep_has_one_answer_per_tick(steps: list[int]) -> None:
    numbers = np.cumsum(np.array(steps) + 1).tolist()
    protocol = playing()
    for number in numbers:
        receive(protocol, tick(number))
        assert next_tick(protocol) == number
        assert protocol.next_event() is None
        assert answer(protocol) == (number, 0)
        with pytest.raises(RuntimeError, match="ready has no move 'answers'"):
            protocol.answer(ACTIONS)


CALLS: dict[Move, Callable[[RunnerProtocol], object]] = {
    "joins": lambda protocol: protocol.receive_assignment(msgpack.packb(REPLY)),
    "is ready": RunnerProtocol.ready,
    "sends": lambda protocol: protocol.send(0, words(0)),
    "answers": lambda protocol: protocol.answer(ACTIONS),
    "leaves": RunnerProtocol.leave,
}
RARE: tuple[Move, ...] = ("leaves",)
COMMON = tuple(move for move in CALLS if move not in RARE)
TICKS, PACKETS = st.sampled_from([*map(tick, range(30))]), st.sampled_from([*map(packets, range(9))])
KINDS = st.sampled_from(("end", "memory", "tick", "packets", "sent", "leave")).map(
    lambda kind: frames.encode(kind, 0, {})
)
FRAMES = st.one_of(TICKS, TICKS, TICKS, PACKETS, PACKETS, KINDS, st.binary(max_size=9))


class AnyOrder(RuleBasedStateMachine):
    """Frames, tokens, calls and events in any order."""

    def __init__(self) -> None:
        super().__init__()
        self.protocol = RunnerProtocol()
        self.received = self.acted_on = self.reported = 0
        self.newest = self.last = -1  # ticks: the newest that was taken, the last that was acted on
        self.ended: Event | None = None

    @initialize(ready=st.sampled_from((False, True, True)))
    def begin(self, ready: bool) -> None:
        if ready:
            self.protocol = playing()

    @rule(present=st.sampled_from((*(True,) * 9, False)))
    def token(self, present: bool) -> None:
        self.protocol.world_present(present)

    @rule(data=FRAMES)
    def frame(self, data: bytes) -> None:
        before = self.protocol.state
        self.protocol.receive_frame(data)
        self.received += 1
        if self.protocol.state == "ended" != before:
            self.acted_on += 1
        elif self.protocol.state in ("joined", "ready", "acting") and _is_tick(data):
            self.newest = max(self.newest, frames.decode(data).tick)

    @rule(move=st.sampled_from((*COMMON * 5, *RARE)))
    def call(self, move: Move) -> None:
        before, fields = self.protocol.state, copy(vars(self.protocol))
        if move in MOVES[before]:
            self.reported += self.protocol.dropped if move == "answers" else 0
            CALLS[move](self.protocol)
            assert self.protocol.state == MOVES[before][move]
        elif move == "leaves":
            assert self.protocol.leave() is None
            assert self.protocol.state == "ended"
        else:
            with pytest.raises(RuntimeError, match=f"a runner that is {before} has no move"):
                CALLS[move](self.protocol)
            assert vars(self.protocol) == fields

    @rule()
    def events(self) -> None:
        while (event := self.protocol.next_event()) is not None and not isinstance(event, Ended):
            self.acted_on += not isinstance(event, PacketsBetween)
            if isinstance(event, Tick):
                assert event.tick == self.newest > self.last
                self.last = event.tick

    @invariant()
    def the_end_is_final(self) -> None:
        if self.ended is not None or self.protocol.state == "ended":
            event = self.protocol.next_event()
            assert isinstance(event, Ended)
            assert event == (self.ended or event)
            self.ended = event

    def teardown(self) -> None:
        """Each frame was acted on or counted; those that wait are counted at the end."""
        self.protocol.leave()
        assert self.received == self.acted_on + self.reported + self.protocol.dropped


def _is_tick(data: bytes) -> bool:
    try:
        return len(frames.decode(data).arrays) > 1 and frames.decode(data).kind == "tick"
    except BadFrame:
        return False


TestAnyOrder = cast("Any", AnyOrder).TestCase
TestAnyOrder.settings = settings(stateful_step_count=30)
