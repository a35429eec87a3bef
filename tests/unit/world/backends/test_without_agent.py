"""Robots without an agent, and the mailbox."""

from typing import Any

import msgpack
import numpy as np
import pytest

from swarmwire.comms.robot.packets import Payloads, ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import GroupMemories, GroupMemory, decode_memory
from swarmwire.comms.wire.tick_frames import decode_tick, encode_actions
from swarmwire.world.backends.join_policy import JoinPolicy
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.realtime import RealTime
from swarmwire.world.backends.registry import OnLoss
from swarmwire.world.backends.runner_reports import RunnerEvent
from swarmwire.world.loop import Mailbox
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.agent.hosts import MEASURES, SILENCE, received_from
from tests.support.world.locksteps import (
    FLOCK,
    GROUPS,
    SCOUTS,
    actions,
    all_readings,
    joined,
    parts,
    ready,
    request,
    rows_of,
)
from tests.support.world.scenes import changed

LAYOUT = {"x": ("<i8", ())}
MEMORY_LAYOUTS = dict.fromkeys(("flock", "scouts", "lone"), LAYOUT)
OPEN = JoinPolicy(open=True, start_with=0, memory=MEMORY_LAYOUTS)
TICK_NS = 10**8
LEAVE = frames.encode("leave", -1, {})
ALIVE = np.ones(15, np.bool_)  # 12 robots of flock, 3 of big


def lockstep(on_loss: OnLoss) -> Lockstep:
    return Lockstep(parts(dict.fromkeys(range(8), 0)), on_loss, OPEN)


def real_time(on_loss: OnLoss) -> RealTime:
    return RealTime(parts(dict.fromkeys(range(8), 0)), 0.5, 30.0, on_loss, OPEN)


def join(roster: Lockstep | RealTime, runner: str, *names: str) -> GroupMemories:
    """Let a runner join with these robots; the memory that it gets."""
    reply = msgpack.unpackb(roster.join(runner, request(names=list(names))))
    ready(roster, runner)
    return decode_memory(frames.decode(reply["memory"]), MEMORY_LAYOUTS)


def open_tick(lockstep: Lockstep, tick: int, received: ReceivedPackets = SILENCE) -> dict[str, list[int]]:
    out = lockstep.open_tick(tick, all_readings(tick), received)
    return {name: rows_of(data) for name, data in out}


def standing(got: Actions) -> list[int]:
    still = got.drive & (got.linear_mps == 0.0) & (got.angular_radps == 0.0)
    return sorted(got.rows[still & (got.rows > 0)].tolist())  # robot 0 of `actions` stands anyway


def answer_with_memory(tick: int, rows: list[int] | None = None, **memory: dict[int, int]) -> bytes:
    """An answer of these robots, or of those in the memory, by group: rows and numbers."""
    rows = [row for group in memory.values() for row in group] if rows is None else rows
    memories = {
        name: GroupMemory(np.array(list(group), np.int64), {"x": np.array(list(group.values()), np.int64)})
        for name, group in memory.items()
    }
    return encode_actions(tick, actions(rows), memory=memories)


@pytest.mark.parametrize("on_loss", ["stand", "coast"])
def test_late_joiner_acts_from_the_next_tick(on_loss: Any) -> None:
    roster = lockstep(on_loss)
    every = list(range(1, 8)) if on_loss == "stand" else []
    assert not roster.waiting
    for tick in range(2):
        assert open_tick(roster, tick) == {}
        assert not roster.waiting
        assert standing(roster.pop_actions()) == every
    open_tick(roster, 2)
    join(roster, "a", "flock-4", "lone-3")
    assert not roster.waiting
    assert standing(roster.pop_actions()) == every
    assert open_tick(roster, 3) == {"a": [4, 3]}
    assert roster.waiting == 1
    roster.answer("a", encode_actions(3, actions([4, 3])))
    got = roster.pop_actions()
    assert standing(got) == [row for row in every if row not in (3, 4)]
    assert sorted(got.rows.tolist()) == (list(range(8)) if every else [3, 4])
    assert roster.counts() == {"runners_joined_late": 1}


@pytest.mark.parametrize("on_loss", ["stand", "coast"])
@pytest.mark.parametrize("answered", [False, True])
def test_runner_lost_within_a_tick_does_not_act_in_it(on_loss: Any, answered: bool) -> None:
    roster = lockstep(on_loss)
    join(roster, "a", "flock-0", "flock-1")
    join(roster, "b", "flock-4", "flock-5")
    open_tick(roster, 0)
    roster.answer("a", answer_with_memory(0, flock={0: 7, 1: 8}))
    if answered:
        roster.answer("b", answer_with_memory(0, flock={4: 7, 5: 8}))
    roster.lose("b", "its link is gone")
    assert not roster.waiting
    got = roster.pop_actions()
    others = [2, 3, 4, 5, 6, 7]
    assert standing(got) == (others if on_loss == "stand" else [])
    assert sorted(got.rows.tolist()) == ([0, 1, *others] if on_loss == "stand" else [0, 1])
    assert open_tick(roster, 1) == {"a": [0, 1]}


def test_packets_for_robots_without_an_agent_are_counted() -> None:
    roster = lockstep("stand")
    join(roster, "a", "flock-0", "flock-1", "scouts-2")
    received = received_from(actions([0]).sent, [1, 4, 5])
    open_tick(roster, 0, received)
    assert roster.counts() == {"packets_without_agent": 2}


def test_packets_are_delivered_to_the_runner_that_is_awaited() -> None:
    roster = ready(joined(Lockstep(parts(dict.fromkeys(range(8), 0)), "wait"), "a"), "a")
    open_tick(roster, 0)
    roster.answer("a", encode_actions(0, actions([*FLOCK, *SCOUTS, 3, 7])))
    roster.lose("a", "its link is gone")
    assert open_tick(roster, 1, received_from(actions([0]).sent, [1, 4, 5])) == {}
    joined(roster, "b")
    [(_, frame)] = roster.answer("b", frames.encode("ready", -1, {}))
    _, received, _ = decode_tick(frames.decode(frame), MEASURES, GROUPS)
    assert received.receiver.tolist() == [1, 4, 5]
    assert "packets_without_agent" not in roster.counts()


def test_memory_follows_its_robots_through_leaving_loss_and_cuts() -> None:
    roster = lockstep("stand")
    assert join(roster, "a", "flock-0", "flock-1", "scouts-2") == {}
    assert join(roster, "b", "flock-4", "lone-3") == {}
    open_tick(roster, 0)
    roster.answer("a", answer_with_memory(0, flock={0: 10, 1: 11}, scouts={2: 12}))
    roster.answer("b", answer_with_memory(0, flock={4: 14}, lone={3: 13}))
    roster.pop_actions()
    open_tick(roster, 1)
    roster.answer("a", LEAVE)
    roster.answer("b", answer_with_memory(1, flock={4: 24}, lone={3: 23}))
    roster.pop_actions()
    open_tick(roster, 2)
    roster.lose("b", "its link is gone")
    again = join(roster, "c", "flock-1", "flock-4", "flock-5", "lone-3")
    remembered = {
        name: dict(zip(memory.rows.tolist(), memory.columns["x"].tolist(), strict=True))
        for name, memory in again.items()
    }
    assert remembered == {"flock": {1: 11, 4: 24}, "lone": {3: 23}}  # flock-5 has none
    others = join(roster, "a", "flock-0", "scouts-2")
    assert others["flock"].columns["x"].tolist() == [10]
    assert others["scouts"].columns["x"].tolist() == [12]


def others_memory(tick: int) -> dict[str, dict[int, int]]:
    return {"flock": {4: tick, 5: tick}, "scouts": {2: tick, 6: tick}, "lone": {3: tick, 7: tick}}


def in_second_tick() -> Lockstep:
    """Runner a answered both ticks, and b, which has the other robots, the first."""
    roster = Lockstep(parts(dict.fromkeys(range(8), 0)), "wait", OPEN)
    join(roster, "a", "flock-0", "flock-1")
    join(roster, "b", "flock-4", "flock-5", "scouts-2", "scouts-6", "lone-3", "lone-7")
    for tick in range(2):
        open_tick(roster, tick)
        roster.answer("a", answer_with_memory(tick, flock={0: tick, 1: 10 + tick}))
        if tick == 0:
            roster.answer("b", answer_with_memory(tick, **others_memory(tick)))
            roster.pop_actions()
    return roster


def test_memory_from_before_the_open_tick_goes_to_the_successor() -> None:
    roster = in_second_tick()
    roster.lose("a", "its link is gone")
    roster.answer("b", answer_with_memory(1, **others_memory(1)))
    assert roster.waiting == 1
    reply = msgpack.unpackb(roster.join("c", request(names=["flock-1"])))
    assert decode_memory(frames.decode(reply["memory"]), MEMORY_LAYOUTS)["flock"].columns["x"].tolist() == [10]
    [(name, frame)] = roster.answer("c", frames.encode("ready", -1, {}))
    assert (name, rows_of(frame), frames.decode(frame).tick) == ("c", [1], 1)
    roster.answer("c", answer_with_memory(1, flock={1: 11}))
    assert roster.waiting == 1
    join(roster, "a", "flock-0")
    roster.answer("a", answer_with_memory(1, flock={0: 1}))
    assert not roster.waiting
    assert sorted(roster.pop_actions().rows.tolist()) == list(range(8))


def test_memory_is_single_when_a_host_loses_a_process_and_leaves() -> None:
    roster = in_second_tick()
    roster.answer("a", frames.encode("lost", -1, {"rows": np.array([1])}, {"process": "1", "reason": "killed"}))
    roster.answer("a", LEAVE)
    memory = join(roster, "a", "flock-0", "flock-1")["flock"]
    assert (memory.rows.tolist(), memory.columns["x"].tolist()) == ([0, 1], [0, 10])


RESTARTED = frames.encode("restarted", -1, {"rows": np.array([1])}, {"process": "1", "reason": "was killed"})


@pytest.mark.parametrize("make_roster", [lockstep, real_time], ids=["lockstep", "real time"])
def test_restarted_process_keeps_its_robots_three_times_at_most(make_roster: Any) -> None:
    roster = make_roster("wait")
    join(roster, "a", "flock-0", "flock-1")
    for _ in range(3):
        roster.answer("a", RESTARTED)
    assert roster.events[-1] == RunnerEvent("restarted", "a/1", ("flock-1",), -1, "was killed")
    assert "flock-1" not in roster.missing_robots
    assert roster.counts() == {"processes_restarted": 3}
    roster.answer("a", RESTARTED)
    assert roster.counts() == {"processes_restarted": 3, "unexpected_kind_frames": 1}
    assert len(roster.events) == 4


def test_restart_in_real_time_begins_the_time_out_again() -> None:
    """The time-out is 30 s; a host with several processes has 1 s more."""
    roster = real_time("wait")
    join(roster, "a", "flock-0", "flock-1")

    def opened_at(tick: int, now_s: int) -> None:
        roster.open_tick(tick, now_s * 10**9, all_readings(tick), SILENCE)

    opened_at(0, 0)
    opened_at(1, 20)
    roster.answer("a", RESTARTED)
    opened_at(2, 49)
    assert not roster.losses
    opened_at(3, 51)
    assert [loss.runner for loss in roster.losses] == ["a"]


@pytest.mark.parametrize(
    "memory", [{"flock": {4: 2}}, {"flock": {0: 1, 4: 2}}, {"flock": {0: 1, 1: 2}, "scouts": {2: 1}}], ids=repr
)
def test_memory_of_foreign_robots_makes_the_answer_malformed(memory: dict[str, dict[int, int]]) -> None:
    roster = lockstep("stand")
    join(roster, "a", "flock-0", "flock-1")
    open_tick(roster, 0)
    roster.answer("a", answer_with_memory(0, [0, 1], **memory))
    assert roster.counts() == {"malformed_frames": 1}
    assert roster.waiting == 1


def test_memory_is_none_if_nobody_may_take_over() -> None:
    roster = joined(Lockstep(parts(dict.fromkeys(range(8), 0)), "dead"))
    assert msgpack.unpackb(roster.join("a", request()))["memory"] is None


def commands(roster: RealTime) -> dict[int, float]:
    got = roster.pop_actions()
    return dict(zip(got.rows[got.drive].tolist(), got.linear_mps[got.drive].tolist(), strict=True))


@pytest.mark.parametrize("on_loss", ["stand", "coast"])
def test_robots_without_a_runner_in_real_time_count_no_watchdog_stop(on_loss: Any) -> None:
    roster = real_time(on_loss)
    for tick in range(3):
        roster.open_tick(tick, tick * TICK_NS, all_readings(tick), SILENCE)
        assert commands(roster) == {}
    join(roster, "a", "flock-1", "flock-5")
    [(name, frame)] = roster.open_tick(3, 3 * TICK_NS, all_readings(3), SILENCE)
    assert (name, rows_of(frame)) == ("a", [1, 5])
    rows = np.array([1, 5])
    moving = Actions(rows, np.ones(2, np.bool_), np.full(2, 0.5), np.zeros(2), np.zeros(2))
    memories = {"flock": GroupMemory(rows, {"x": np.array([7, 8])})}
    roster.answer("a", encode_actions(3, moving, memory=memories))
    assert commands(roster) == {1: 0.5, 5: 0.5}
    roster.open_tick(4, 4 * TICK_NS, all_readings(4), SILENCE)
    roster.answer("a", LEAVE)
    assert commands(roster) == ({1: 0.0, 5: 0.0} if on_loss == "stand" else {})
    for tick in range(5, 20):
        assert roster.open_tick(tick, tick * TICK_NS, all_readings(tick), SILENCE) == []
        assert commands(roster) == {}
    assert not roster.watchdog_stops.any()
    assert join(roster, "b", "flock-5")["flock"].columns["x"].tolist() == [8]
    assert [name for name, _ in roster.open_tick(20, 20 * TICK_NS, all_readings(20), SILENCE)] == ["b"]


def world(flock: int, big: int) -> World:
    mapping = changed("robots.flock.act_every_ticks", flock)
    mapping["robots"]["big"]["act_every_ticks"] = big
    return World(scenario_from(mapping, "sample"), [1], {"flock": ("odometry",), "big": ("compass",)})


def received(*packets: tuple[int, int, int, int]) -> ReceivedPackets:
    """Receiver, sender, sequence and received_at_ns of each packet, sorted; its payload has them all."""
    table = np.array(sorted((p[0], p[3], p[1], p[2]) for p in packets), np.int64).reshape(-1, 4)
    receiver, received_at_ns, sender, sequence = (np.ascontiguousarray(column) for column in table.T)
    payloads = Payloads.from_rows([bytes([r, s, q, t]) for r, t, s, q in table.tolist()])
    measured = {"range_m": sender * 0.5}
    return ReceivedPackets(receiver, sender, sequence, received_at_ns, measured, np.arange(len(table)), payloads)


def read(packets: ReceivedPackets) -> list[tuple[int, ...]]:
    """The arguments of `received`, as both the payloads and the columns have them."""
    arrays = packets.receiver, packets.sender_index, packets.sequence, packets.received_at_ns
    columns = list(zip(*(array.tolist() for array in arrays), strict=True))
    assert [tuple(packets.payloads.row(p)) for p in packets.payload.tolist()] == columns
    assert packets.measured["range_m"].tolist() == [0.5 * sender for _, sender, _, _ in columns]
    return columns


def test_mailbox_delivers_waiting_packets_at_once_in_order():
    box = Mailbox(world(1, 3).static)
    first = box.pop_packets(1, received((0, 1, 0, 5), (12, 3, 0, 7), (12, 2, 0, 9)), ALIVE)
    assert read(first) == [(0, 1, 0, 5)]
    assert read(box.pop_packets(2, received((12, 1, 4, 9), (13, 1, 4, 11)), ALIVE)) == []
    third = box.pop_packets(3, received((0, 2, 1, 21), (12, 2, 1, 20)), ALIVE)
    by_time = [(12, 3, 0, 7), (12, 1, 4, 9), (12, 2, 0, 9), (12, 2, 1, 20)]
    assert read(third) == [(0, 2, 1, 21), *by_time, (13, 1, 4, 11)]
    assert read(box.pop_packets(6, received(), ALIVE)) == []


def test_mailbox_stores_a_shared_payload_once():
    box = Mailbox(world(1, 2).static)
    shared = received((12, 1, 0, 5), (13, 1, 0, 5), (14, 1, 0, 5))
    box.pop_packets(1, shared.select(np.array([0, 1, 2])), ALIVE)
    assert len(box._packets.payloads) == 3
    packets = ReceivedPackets(
        *(getattr(shared, n) for n in ("receiver", "sender_index", "sequence", "received_at_ns", "measured")),
        np.zeros(3, np.int64),
        shared.payloads,
    )
    box = Mailbox(world(1, 2).static)
    box.pop_packets(1, packets, ALIVE)
    assert len(box._packets.payloads) == 1


def test_mailbox_drops_packets_of_a_robot_that_dies():
    box = Mailbox(world(1, 3).static)
    box.pop_packets(1, received((12, 3, 0, 7), (13, 3, 0, 7)), ALIVE)
    box.pop_packets(2, received(), np.arange(15) != 12)
    assert read(box.pop_packets(3, received(), ALIVE)) == [(13, 3, 0, 7)]


def tx_status(*rows: tuple[int, int, int]) -> TxStatuses:
    return TxStatuses(*np.array(rows, np.int64).reshape(-1, 3).T)


def status_rows(statuses: TxStatuses) -> list[tuple[int, ...]]:
    return list(zip(statuses.row.tolist(), statuses.id.tolist(), statuses.result.tolist(), strict=True))


def test_mailbox_holds_tx_status_until_robots_act_except_dead_ones():
    box = Mailbox(world(1, 3).static)
    first = box.pop_tx_statuses(1, tx_status((0, 4, 1), (12, 0, 0), (13, 0, 2)), ALIVE)
    assert status_rows(first) == [(0, 4, 1)]
    assert status_rows(box.pop_tx_statuses(2, tx_status((12, 2, 0), (14, 1, 0)), np.arange(15) != 13)) == []
    third = box.pop_tx_statuses(3, tx_status((0, 5, 0), (12, 1, 3)), ALIVE)
    assert status_rows(third) == [(0, 5, 0), (12, 0, 0), (12, 1, 3), (12, 2, 0), (14, 1, 0)]
    assert status_rows(box.pop_tx_statuses(6, tx_status(), ALIVE)) == []


def test_groups_sense_only_in_ticks_in_which_they_act():
    acting = world(2, 3)
    assert [sorted(acting.sense(tick)) for tick in range(7)] == [
        ["big", "flock"],
        [],
        ["flock"],
        ["big"],
        ["flock"],
        [],
        ["big", "flock"],
    ]
