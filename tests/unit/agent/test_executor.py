"""What an agent sees through its handle, and what becomes of its memory, its commands and its errors."""

import re
from operator import attrgetter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent import Robot, Robots
from swarmwire.agent.agent import AgentClass
from swarmwire.agent.executor import AgentExecutor
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.messages import encode_dict
from swarmwire.comms.robot.packets import TAG_BYTES, Payloads, ReceivedPackets, SentPackets
from swarmwire.comms.robot.tick_io import Actions
from tests.support.agent.hosts import (
    SILENCE,
    agents_for,
    assignment,
    group,
    one_group,
    plain,
    readings,
    received_from,
    spec,
    step,
    words,
)
from tests.support.agent.one_step import agent_doing, vector_agent_doing
from tests.support.agent.players import Chatter, Counter, Failing, Other, Unmade, VectorCounter, Word


def once(kind: AgentClass, rows: list[int], received: ReceivedPackets = SILENCE, tick: int = 0) -> Actions:
    return step(agents_for(kind, rows), tick, rows, received)


def failure(kind: AgentClass, received: ReceivedPackets = SILENCE) -> AgentFailed:
    with pytest.raises(AgentFailed) as caught:
        once(kind, [2, 5], received)
    return caught.value


READS = {
    "proximity": lambda robot: robot.proximity.value,
    "compass": lambda robot: robot.compass.heading_rad,
    "odometry": lambda robot: robot.odometry.left_m,
}


@pytest.mark.parametrize("sensor", sorted(READS))
def test_sensor_without_a_declaration_cannot_be_read(sensor: str) -> None:
    others = READS.keys() - {sensor}
    single = failure(agent_doing(READS[sensor], *others))
    vector = failure(vector_agent_doing(READS[sensor], *others))
    assert single.robots == "flock-2"
    assert vector.robots == "flock-2, flock-5"
    for error in (single, vector):
        assert f"NotDeclared: reads '{sensor}', which its needs do not list" in error.traceback
        assert re.search(r"one_step\.py.*in step", error.traceback)


def test_reading_without_a_field_names_its_fields() -> None:
    reads = agent_doing(attrgetter("compass.value"), "compass")
    lines = failure(reads).traceback.splitlines()
    assert "AttributeError" in lines[-3]
    assert lines[-2].startswith("CompassReading has heading_rad")


def test_declared_sensors_return_the_robots_own_readings() -> None:
    results: list[tuple[float, ...]] = []

    def read(robot: Robot) -> None:
        ray = float(robot.proximity.value[3])
        results.append((ray, robot.compass.heading_rad, robot.odometry.left_m, robot.odometry.right_m))
        assert robot.proximity.angle_rad.shape == robot.proximity.distance_m.shape == (8,)
        assert (robot.time_s, robot.period_s, robot.body.name) == (0.4, 0.1, "epuck")

    once(agent_doing(read, *READS), [2, 5], tick=4)
    fields = readings(4, [2, 5]).fields
    columns = (fields["proximity.value"][:, 3], *(fields[n] for n in list(fields)[1:]))
    assert results == list(zip(*(column.tolist() for column in columns), strict=True))


@pytest.mark.parametrize(("name", "need"), [("range_m", "range"), ("bearing_rad", "bearing"), ("rssi_dbm", "rssi")])
def test_radio_measurements_must_be_declared(name: str, need: str) -> None:
    others = {"radio.range", "radio.bearing", "radio.rssi"} - {f"radio.{need}"}
    single = agent_doing(lambda robot: [getattr(packet, name) for packet in robot.radio.received(Word)], *others)
    vector = vector_agent_doing(lambda robots: getattr(robots.radio.received(Word), name), *others)
    for kind in (single, vector):
        traceback = failure(kind, received_from(words(0), [2, 5])).traceback
        assert f"NotDeclared: reads 'radio.{need}' of a packet" in traceback


def test_packets_have_sender_sequence_time_range_and_bearing() -> None:
    results: list[list[tuple[float, ...]]] = []

    def read(robot: Robot) -> None:
        packets = robot.radio.received(Word)
        results.append([(p.message.number, p.sender, p.sequence, p.received_at_ns, p.range_m) for p in packets])
        assert all(-1.0 <= p.bearing_rad <= 1.0 for p in packets)

    received = received_from(words(0, 2, 7), [2, 3, 5])  # robot 3 belongs to another group
    once(agent_doing(read, "radio.range", "radio.bearing"), [2, 5], received)
    sender, range_m = received.sender_index, received.measured["range_m"]
    columns = sender.astype(float), sender, received.sequence, received.received_at_ns, range_m
    rows = list(zip(received.receiver.tolist(), *(column.tolist() for column in columns), strict=True))
    assert results == [[row[1:] for row in rows if row[0] == receiver] for receiver in (2, 5)]
    assert [len(packets) for packets in results] == [2, 3]


def test_message_of_another_class_or_length_is_not_received() -> None:
    counts: list[tuple[int, int]] = []

    def count(robot: Robot) -> None:
        counts.append((len(robot.radio.received(Word)), len(robot.radio.received(Other))))

    word = Word(number=1.0).encode()
    payloads = [Other(number=3).encode(), word, word + b"\0", word[:-1], word[:2], b"", b"\x01"]
    sent = SentPackets(np.zeros(7, np.int64), np.full(7, BROADCAST), Payloads.from_rows(payloads))
    once(agent_doing(count), [2], received_from(sent, [2]))
    assert counts == [(1, 1)]


def test_dict_is_sent_and_received_as_a_message() -> None:
    messages: list[object] = []

    def echo(robot: Robot) -> None:
        messages.extend(packet.message for packet in robot.radio.received(dict))
        robot.radio.send({"state": "search", "at": [1, 2.5]})

    agents = agents_for(agent_doing(echo), [2, 5])
    sent = step(agents, 0, [2, 5]).sent
    step(agents, 1, [2, 5], received_from(sent, [2, 5]))
    assert messages == [{"state": "search", "at": [1, 2.5]}] * 2


JUNK = (b"", b"\x05", b"\x81", b"\x81\x80\x01", b"\x81\x91\x01\x01", b"\x93\x01\x02\x03", b"\x80\x00", b"\xc1")


@pytest.mark.parametrize("junk", [*JUNK, b"\x91" * 2000])
def test_dict_message_of_malformed_bytes_is_not_received(junk: bytes) -> None:
    """A foreign runner may send any bytes: they must not end the run at a receiver."""
    messages: list[object] = []

    reads = agent_doing(lambda robot: messages.extend(packet.message for packet in robot.radio.received(dict)))
    dict_tag = bytes(TAG_BYTES)
    payloads = Payloads.from_rows([dict_tag + junk, encode_dict({"x": 1}), dict_tag + junk])
    once(reads, [2], received_from(SentPackets(np.zeros(3, np.int64), np.full(3, BROADCAST), payloads), [2]))
    assert messages == [{"x": 1}]


def test_packet_ids_count_per_robot_and_continue_after_an_absence() -> None:
    ids: list[int] = []

    def send(robot: Robot) -> None:
        ids.extend((robot.radio.send(Word(number=0.0)), robot.radio.send({"x": 1}, to=3)))

    def send_all(robots: Robots) -> None:
        first = robots.radio.send(Word, number=0.0)
        ids.extend(np.stack([first, robots.radio.send(Word, to=3, number=1.0)], 1).ravel().tolist())

    for kind in (agent_doing(send), vector_agent_doing(send_all)):
        agents = agents_for(kind, [2, 5])
        ids.clear()
        for tick, rows in enumerate(([2, 5], [5], [2, 5])):
            step(agents, tick, rows)
        assert ids == [0, 1, 0, 1, 2, 3, 2, 3, 4, 5]


def test_packet_addresses_apply_to_the_rows_of_the_mask() -> None:
    columns = {"rows": np.array([True, False, True]), "to": np.array([7, 8, 9]), "number": np.arange(3.0)}
    sent = once(vector_agent_doing(lambda robots: robots.radio.send(Word, **columns)), [1, 4, 6]).sent
    assert (sent.sender.tolist(), sent.to.tolist()) == ([1, 6], [7, 9])
    assert [Word.decode(sent.payloads.row(i)).number for i in range(2)] == [0.0, 2.0]


def test_command_exists_only_for_robots_that_drive() -> None:
    def drive_rows(robots: Robots) -> None:
        robots.drive(0.3, np.arange(3.0), rows=np.array([False, True, True]))
        robots.drive(np.full(3, 0.5), 9.0, rows=np.array([False, True, False]))

    agents = agents_for(agent_doing(lambda robot: robot.time_s < 0.05 and robot.drive(0.1, -0.2)), [2, 5])
    first, second = step(agents, 0, [2, 5]), step(agents, 1, [2, 5])
    assert (first.drive.tolist(), first.linear_mps.tolist(), first.angular_radps.tolist()) == (
        [True, True],
        [0.1, 0.1],
        [-0.2, -0.2],
    )
    assert second.drive.tolist() == [False, False]
    rows = once(vector_agent_doing(drive_rows), [1, 2, 3])
    assert rows.drive.tolist() == [False, True, True]
    assert rows.linear_mps[1:].tolist() == [0.5, 0.3]
    assert rows.angular_radps[1:].tolist() == [9.0, 2.0]


@pytest.mark.parametrize("kind", [Counter, VectorCounter])
def test_returning_robot_starts_anew_and_others_keep_their_memory(kind: AgentClass) -> None:
    agents = agents_for(kind, [2, 5, 6])
    steps: list[list[float]] = []
    for tick, rows in enumerate(([2, 5, 6], [2, 5, 6], [2, 6], [2, 5, 6], [], [2, 6])):
        steps.append(step(agents, tick, rows).linear_mps.tolist())
    assert steps == [[1, 1, 1], [2, 2, 2], [3, 3], [4, 1, 4], [], [1, 1]]


@pytest.mark.parametrize("kind", ["Counter", "VectorCounter"])
def test_memory_does_not_depend_on_other_robots_in_the_process(kind: str) -> None:
    together = AgentExecutor(assignment(group(spec(kind), [2, 5])))
    alone = {row: AgentExecutor(assignment(group(spec(kind), [row]))) for row in (2, 5)}
    for tick, rows in enumerate(([2, 5], [2], [2, 5], [], [5], [2, 5])):
        at_once = together.act(tick, one_group(tick, rows), SILENCE)
        each = [alone[row].act(tick, one_group(tick, [row] if row in rows else []), SILENCE) for row in (2, 5)]
        assert plain(at_once) == plain(Actions.joined(each))


def test_step_is_not_called_without_robots() -> None:
    def check(robots: Robots) -> None:
        assert robots.n

    assert len(step(agents_for(vector_agent_doing(check), [2]), 0, []).rows) == 0


def test_agent_error_names_the_robot_with_its_traceback() -> None:
    agents = agents_for(Failing, [0, 1, 2, 3])
    step(agents, 1, [0, 1, 2, 3])
    with pytest.raises(AgentFailed) as caught:
        step(agents, 2, [0, 3])
    assert caught.value.robots == "flock-0"
    assert "players.py" in caught.value.traceback
    with pytest.raises(AgentFailed) as unmade:
        agents_for(Unmade, [2, 5])
    assert unmade.value.robots == "flock-2, flock-5"
    assert "no memory left" in unmade.value.traceback


def test_draws_belong_to_robot_tick_and_purpose() -> None:
    drawn: list[tuple[float, ...]] = []

    def draw_all(robot: Robot) -> None:
        draw = robot.draw
        drawn.append((draw.uniform("a"), draw.uniform("b"), draw.uniform("a"), draw.normal("a"), draw.normal("c")))

    def draws_of(rows: list[int], tick: int) -> list[tuple[float, ...]]:
        drawn.clear()
        once(agent_doing(draw_all), rows, tick=tick)
        return list(drawn)

    together = draws_of([1, 2, 7], 3)
    assert draws_of([7], 3) + draws_of([1], 3) == [together[2], together[0]]  # whoever else draws
    assert draws_of([1, 2, 7], 3) == together
    values = [value for tick in range(4) for row in draws_of([1, 2, 7], tick) for value in row]
    assert len(set(values)) == len(values)


@given(st.lists(st.integers(0, 50), min_size=1, max_size=6, unique=True).map(sorted), st.integers(0, 2**40))
def test_draws_of_a_row_equal_those_of_the_robot_alone(rows: list[int], tick: int) -> None:
    def walk(handle: Any) -> None:
        handle.draw.normal("turn")
        handle.drive(handle.draw.uniform("speed", -1.0, 3.0), handle.draw.normal("turn", 5.0, 2.0))

    single, vector = (once(kind(walk), rows, tick=tick) for kind in (agent_doing, vector_agent_doing))
    assert plain(single) == plain(vector)
    assert np.all((single.linear_mps >= -1.0) & (single.linear_mps < 3.0))


def test_split_group_acts_like_the_undivided_group() -> None:
    together, first, second = (agents_for(Chatter, rows) for rows in ([0, 1, 2, 3], [0, 3], [1, 2]))
    sent = SentPackets.none()
    for tick in range(5):
        received = received_from(sent, [0, 1, 2, 3])
        expected = step(together, tick, [0, 1, 2, 3], received)
        parts = [step(second, tick, [1, 2], received), step(first, tick, [0, 3], received)]
        assert plain(Actions.joined(parts)) == plain(expected)
        sent = expected.sent


def test_last_noted_state_in_a_tick_counts() -> None:
    def note_twice(robots: Robots) -> None:
        robots.note("search")
        robots.note("wait", rows=np.array([False, True, False]))

    notes = once(vector_agent_doing(note_twice), [1, 4, 6]).notes
    assert [notes.names[index] for index in notes.integers] == ["search", "wait", "search"]
    agents = agents_for(agent_doing(lambda robot: robot.time_s or robot.note(state="search")), [2, 5])
    assert [len(step(agents, tick, [2, 5]).notes) for tick in (0, 1)] == [2, 0]


def test_last_noted_number_in_a_tick_counts() -> None:
    def note_twice(robots: Robots) -> None:
        robots.note("search", value=np.array([1.0, 2.0, 3.0]))
        robots.note(value=np.array([np.nan, 5.0, np.inf]), rows=np.array([False, True, False]))

    def note_at_first(robot: Robot) -> None:
        if robot.time_s == 0.0:
            robot.note(value=0.5)
            robot.note("search", value=1.25)

    actions = once(vector_agent_doing(note_twice), [1, 4, 6])
    assert (actions.values.rows.tolist(), actions.values.value.tolist()) == ([1, 4, 6], [1.0, 5.0, 3.0])
    assert len(actions.notes) == 3
    mask = np.array([True, False, True])
    masked = once(vector_agent_doing(lambda robots: robots.note(value=4, rows=mask)), [1, 4, 6])
    assert (masked.values.rows.tolist(), masked.values.value.tolist(), len(masked.notes)) == ([1, 6], [4.0, 4.0], 0)
    agents = agents_for(agent_doing(note_at_first), [2, 5])
    first, second = (step(agents, tick, [2, 5]) for tick in (0, 1))
    assert (first.values.value.tolist(), len(first.notes), len(second.values)) == ([1.25, 1.25], 2, 0)


@pytest.mark.parametrize("state", ["", "x" * 65, 3], ids=repr)
def test_noted_state_is_a_short_text(state: object) -> None:
    wrong = agent_doing(lambda robot: robot.note(state))  # pyright: ignore[reportArgumentType] - a wrong state
    assert "expected a text of 1 to 64 characters" in failure(wrong).traceback
