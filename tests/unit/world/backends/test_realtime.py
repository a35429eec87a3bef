"""Runs in real time."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, SparseTable
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.join import JoinRequest
from swarmwire.comms.wire.tick_frames import decode_packets, encode_actions, encode_sent
from swarmwire.world.backends.pacing import LatencyHistogram, LatencySummary, Pace
from swarmwire.world.backends.realtime import RealTime
from swarmwire.world.backends.registry import OnLoss
from swarmwire.world.backends.runner_reports import RunnerHealth
from tests.support.agent.hosts import MEASURES, SILENCE, assignment, group, one_group, received_from
from tests.support.clocks import FakeClock

ROWS = [0, 1, 2, 3]
ROWS_OF = {"a": [0, 2], "b": [1, 3]}
TICK_NS = NS_PER_S // 10  # wall time, at factor 1


def join(runners: RealTime, name: str) -> None:
    runners.join(name, JoinRequest().encode())
    runners.answer(name, frames.encode("ready", -1, {}))


def playing(on_loss: OnLoss = "stop", timeout_s: float = 30.0, names: str = "ab", **options: bool) -> RealTime:
    """Runners that have joined, of which each has two robots."""
    parts = [assignment(group("unused:A", rows)) for rows in ROWS_OF.values()]
    runners = RealTime(parts, 0.5, timeout_s, on_loss, **options)
    for name in names:
        join(runners, name)
    return runners


def open_tick(runners: RealTime, tick: int, received: ReceivedPackets = SILENCE, rows: list[int] = ROWS) -> list[str]:
    out = runners.open_tick(tick, tick * TICK_NS, one_group(tick, rows), received)
    return [name for name, _ in out]


def answer_of(runner: str, tick: int, speed: float, drive: bool = True) -> bytes:
    """An answer that commands `speed` and sends a packet with the tick from each robot."""
    rows = np.array(ROWS_OF[runner], np.int64)
    sent = SentPackets(rows, np.full(len(rows), BROADCAST), Payloads.from_rows([bytes([0, 0, tick])] * len(rows)))
    speeds = np.full(len(rows), speed)
    return encode_actions(tick, Actions(rows, np.full(len(rows), drive), speeds, -speeds, 2.0 * speeds, sent))


def answer_with(tick: int, rows: Sequence[int], **tables: SparseTable) -> bytes:
    """An answer of robots that command nothing, with LEDs, values, …"""
    still = np.zeros(len(rows))
    return encode_actions(tick, Actions(np.array(rows, np.int64), still.astype(bool), still, still, still, **tables))


def table(rows: Sequence[int], slots: Sequence[int], values: Sequence[float]) -> SparseTable:
    return SparseTable(np.array(rows, np.int64), np.array(slots, np.int64), np.array(values))


def pop(runners: RealTime) -> tuple[dict[int, float], list[int]]:
    """The new commands by robot, and the ticks in the packets."""
    got = runners.pop_actions()
    commands = {int(row): float(v) for row, v in zip(got.rows[got.drive], got.linear_mps[got.drive], strict=True)}
    assert (got.angular_radps == -got.linear_mps).all()
    assert (got.lateral_mps == 2.0 * got.linear_mps).all()
    return commands, [got.sent.payloads.row(i)[2] for i in range(len(got.sent))]


def state(runners: RealTime) -> Any:
    slots = [(slot.runner, slot.state, list(slot.unanswered)) for slot in runners._allocations]
    arrays = (runners._pending_since_ns, runners._stopped, runners._drive, runners._command, runners.late)
    return slots, [array.tolist() for array in arrays], len(runners._sent), runners.frames_dropped


def test_answers_within_their_tick_are_commands_of_that_tick() -> None:
    runners = playing()
    for tick in range(3):
        assert open_tick(runners, tick) == ["a", "b"]
        for name in ("b", "a"):
            runners.answer(name, answer_of(name, tick, tick + 0.5))
        assert pop(runners) == (dict.fromkeys(ROWS, tick + 0.5), [tick] * 4)
    assert not runners.counts()
    assert not runners.late.any()
    assert (runners.frames_dropped, runners.packets_dropped) == (0, 0)


def test_late_answer_applies_and_sends_when_it_arrives() -> None:
    runners = playing()
    open_tick(runners, 0)
    runners.answer("b", answer_of("b", 0, 1.0))
    assert pop(runners) == ({1: 1.0, 3: 1.0}, [0, 0])
    open_tick(runners, 1)
    runners.answer("a", answer_of("a", 0, 2.0))
    assert pop(runners) == ({0: 2.0, 2: 2.0}, [0, 0])
    assert runners.late.tolist() == [1, 0, 1, 0]
    assert pop(runners) == ({}, [])  # once


def test_newer_of_two_answers_commands_and_both_send() -> None:
    runners = playing()
    open_tick(runners, 0)
    open_tick(runners, 1)
    runners.answer("a", answer_of("a", 0, 1.0))
    runners.answer("a", answer_of("a", 1, 2.0))
    assert pop(runners) == ({0: 2.0, 2: 2.0}, [0, 0, 1, 1])
    assert runners.late.tolist() == [1, 0, 1, 0]
    open_tick(runners, 2)
    open_tick(runners, 3)
    runners.answer("a", answer_of("a", 2, 3.0))
    runners.answer("a", answer_of("a", 3, 9.0, drive=False))  # without a new command the previous one holds
    assert pop(runners)[0] == {0: 3.0, 2: 3.0}


def test_leds_and_noted_values_of_two_answers_are_merged_in_their_order() -> None:
    runners = playing()
    open_tick(runners, 0)
    open_tick(runners, 1)
    leds = table([0, 2], [3, 3], [7.0, 8.0]), table([2, 2], [3, 4], [9.0, 10.0])
    values = table([0, 2], [0, 0], [0.5, 0.5]), table([2], [0], [0.75])
    for tick in range(2):
        runners.answer("a", answer_with(tick, [0, 2], leds=leds[tick], values=values[tick]))
    got = runners.pop_actions()
    rows, slots = got.leds.rows.tolist(), got.leds.slot.tolist()
    assert (rows, slots, got.leds.value.tolist()) == ([0, 2, 2, 2], [3, 3, 3, 4], [7, 8, 9, 10])
    assert (got.values.rows.tolist(), got.values.value.tolist()) == ([0, 2, 2], [0.5, 0.5, 0.75])
    later = runners.pop_actions()
    assert len(later.leds) == len(later.values) == 0


@pytest.mark.parametrize("tick", [0, 1, 2, 4])
def test_answer_to_an_old_or_future_tick_changes_nothing(tick: int) -> None:
    runners = playing()
    for opened_tick in range(4):
        open_tick(runners, opened_tick)
        if opened_tick == 2:
            runners.answer("a", answer_of("a", 2, 1.0))
    before = state(runners)
    runners.answer("a", answer_of("a", tick, 5.0))
    assert state(runners) == before
    assert runners.counts() == {"wrong_tick_frames": 1}


def test_skipped_frames_are_counted_with_their_packets_and_tx_status() -> None:
    runners = playing()
    sent = SentPackets(np.array([1]), np.array([BROADCAST]), Payloads.from_rows([b"xyz"]))
    statuses = TxStatuses(np.array([0, 0, 1]), np.array([0, 1, 0]), np.array([0, 1, 0]))  # two to a, one to b
    received = received_from(sent, [0, 2, 3])  # two packets to a, one to b
    runners.open_tick(0, 0, one_group(0, ROWS), received, statuses)
    open_tick(runners, 1, received_from(sent, [0]))
    open_tick(runners, 2, received_from(sent, [2]))
    assert (runners.frames_dropped, runners.packets_dropped, runners.tx_status_dropped) == (0, 0, 0)
    runners.answer("a", answer_of("a", 2, 1.0))
    assert (runners.frames_dropped, runners.packets_dropped, runners.tx_status_dropped) == (2, 3, 2)
    assert not runners.late.any()
    runners.answer("b", answer_of("b", 0, 1.0))
    assert (runners.frames_dropped, runners.packets_dropped, runners.tx_status_dropped) == (2, 3, 2)


def test_watchdog_stops_a_robot_without_answers_once() -> None:
    runners = playing()
    for tick in range(12):
        open_tick(runners, tick)
        if tick == 0:
            runners.answer("a", answer_of("a", 0, 1.0))
        runners.answer("b", answer_of("b", tick, 1.0))
        commands, _ = pop(runners)
        # No answer of a from tick 1, at 0.1 s; the stop follows 0.5 s later, once.
        assert commands.get(0) == {0: 1.0, 6: 0.0}.get(tick)
        assert commands[1] == 1.0
    assert runners.watchdog_stops.tolist() == [1, 0, 1, 0]


def test_watchdog_restarts_with_a_fresh_command() -> None:
    runners = playing()
    for tick in range(20):
        open_tick(runners, tick)
        if tick == 8:
            runners.answer("a", answer_of("a", 7, 2.0))  # fresh although late
        commands, _ = pop(runners)
        assert commands.get(0) == {5: 0.0, 8: 2.0, 14: 0.0}.get(tick)
    assert runners.watchdog_stops.tolist() == [2, 1, 2, 1]
    assert runners.late.tolist() == [1, 0, 1, 0]


def test_watchdog_does_not_stop_a_robot_that_acts_seldom() -> None:
    runners = playing()
    for tick in range(30):
        acts = tick % 10 == 0
        open_tick(runners, tick, rows=ROWS if acts else [])
        if acts:
            runners.answer("a", answer_of("a", tick, 1.0))
        pop(runners)
    assert runners.watchdog_stops.tolist() == [0, 1, 0, 1]


def test_robots_of_a_dead_runner_stand_still_to_the_end() -> None:
    runners = playing("dead")
    open_tick(runners, 0)
    runners.answer("a", answer_of("a", 0, 1.0))
    runners.lose("a", "its link is gone")
    assert pop(runners)[0] == {0: 0.0, 2: 0.0}
    for tick in range(1, 9):
        assert open_tick(runners, tick) == ["b"]
        runners.answer("a", answer_of("a", 0, 1.0))
        runners.answer("b", answer_of("b", tick, 1.0))
        assert pop(runners)[0] == {1: 1.0, 3: 1.0}
    assert [str(loss) for loss in runners.losses] == ["a, which played flock-0, flock-2: its link is gone"]
    assert runners.counts() == {"runners_lost": 1, "unknown_runner_frames": 8}
    assert not runners.watchdog_stops.any()


def test_successor_of_a_lost_runner_drives_its_robots_on() -> None:
    runners = playing("wait")
    for tick in range(12):
        names = open_tick(runners, tick)
        assert names == (["b"] if 2 < tick < 10 else ["c" if tick >= 10 else "a", "b"])
        for name in names:
            runners.answer(name, answer_of("a" if name == "c" else name, tick, 1.0))
        if tick == 2:
            runners.lose("a", "its link is gone")
        if tick == 9:
            join(runners, "c")
        assert pop(runners)[0].get(0) == (0.0 if tick == 8 else 1.0 if not 2 < tick < 10 else None)


def test_runner_is_lost_after_its_timeout() -> None:
    runners = playing("dead", timeout_s=1.0)
    for tick in range(12):
        open_tick(runners, tick)
        runners.answer("b", answer_of("b", tick, 1.0))
        assert len(runners.losses) == (tick > 10)  # asked at 0.0 s
    assert runners.losses[0].reason == "no answer for 1 s"


def test_health_counts_runners_and_their_omissions() -> None:
    runners = playing("dead")
    assert runners.health() == RunnerHealth(ready=2, lost=0)
    for tick in range(7):
        open_tick(runners, tick)
        runners.answer("a", answer_of("a", tick, 1.0))
        pop(runners)
    runners.answer("b", answer_of("b", 5, 1.0))
    assert runners.health() == RunnerHealth(2, 0, late_answers=2, frames_dropped=5, watchdog_stops=2)
    runners.lose("a", "its link is gone")
    assert (runners.health().ready, runners.health().lost) == (1, 1)


def test_pause_counts_neither_for_time_outs_nor_watchdogs() -> None:
    clock, pause_ns = FakeClock(), 3600 * NS_PER_S
    pace = Pace(clock, 10, 1.0, lambda _: None)
    runners = playing("dead", timeout_s=1.0)
    runners.open_tick(0, pace.begin(), one_group(0, ROWS), SILENCE)
    pace.wait(0)
    assert pop(runners) == ({}, [])
    clock.time_ns += pause_ns
    pace.restart(1, 1.0, pause_ns)
    runners.open_tick(1, pace.begin(), one_group(1, ROWS), SILENCE)
    assert not runners.losses
    for name in ROWS_OF:
        runners.answer(name, answer_of(name, 0, 1.0))
    assert pop(runners) == (dict.fromkeys(ROWS, 1.0), [0] * 4)
    assert not runners.watchdog_stops.any()
    clock.time_ns += 2 * NS_PER_S  # not a pause: a loop that lags
    runners.open_tick(2, pace.begin(), one_group(2, ROWS), SILENCE)
    assert [loss.reason for loss in runners.losses] == ["no answer for 1 s"] * 2


def in_subticks() -> RealTime:
    return playing("dead", subtick=True)


def broadcasts(*senders: int) -> SentPackets:
    return SentPackets(
        np.array(senders), np.full(len(senders), BROADCAST), Payloads.from_rows([bytes(3)] * len(senders))
    )


def test_subtick_frames_go_to_every_ready_runner_with_rising_numbers() -> None:
    runners = in_subticks()
    open_tick(runners, 0)
    statuses = TxStatuses(np.array([3]), np.array([0]), np.array([1]))
    for number in range(2):
        out = dict(runners.deliver(0, 5_000_000, received_from(broadcasts(1), [0, 2]), statuses))
        assert list(out) == ["a", "b"]
        at_ns, got, received, tx_status = decode_packets(frames.decode(out["a"]), MEASURES)
        assert (at_ns, got, received.receiver.tolist(), len(tx_status)) == (5_000_000, number, [0, 2], 0)
        _, _, nothing, tx_status = decode_packets(frames.decode(out["b"]), MEASURES)
        assert (len(nothing), tx_status.row.tolist()) == (0, [3])
    assert runners.deliver(0, 6_000_000, SILENCE, TxStatuses(*np.empty((3, 0), np.int64))) == []


def test_subtick_packets_of_robots_without_a_runner_are_dropped() -> None:
    runners = playing("wait", names="a", subtick=True)
    assert [name for name, _ in runners.deliver(0, 0, received_from(broadcasts(0), [1, 2, 3]), NO_TX_STATUSES)] == ["a"]
    assert runners.packets_dropped == 2


def test_subtick_sent_packets_have_their_time_and_tick() -> None:
    runners = in_subticks()
    open_tick(runners, 0)
    runners.now_ns = 5
    runners.answer("b", answer_of("b", 0, 1.0))
    runners.now_ns = 7
    runners.answer("a", encode_sent(0, broadcasts(2), missed=3))
    entries = runners.pop_sent()
    assert [(entry.at_ns, entry.tick, entry.sent.sender.tolist()) for entry in entries] == [
        (5, 0, [1, 3]),
        (7, None, [2]),
    ]
    assert runners.pop_sent() == []
    commands, sent = pop(runners)
    assert (commands, sent) == ({1: 1.0, 3: 1.0}, [])
    assert runners.counts() == {"packets_frames_missed_by_runners": 3}


@pytest.mark.parametrize(
    ("make", "data", "fault"),
    [
        *(
            (playing, data, "malformed")
            for data in (b"", b"\xc1", answer_of("b", 0, 1.0), frames.encode("actions", 0, {}))
        ),
        *((playing, answer_with(0, rows), "malformed") for rows in ([0, 0], [1], [7])),  # repeated, of b, of nobody
        (in_subticks, encode_sent(0, broadcasts(1)), "malformed"),  # a robot of b
        (in_subticks, frames.encode("sent", 0, {}), "malformed"),
        (playing, encode_sent(0, broadcasts(2)), "unexpected_kind"),
    ],
)
def test_bad_frame_of_a_runner_is_counted_and_changes_nothing(make: Any, data: bytes, fault: str) -> None:
    runners = make()
    open_tick(runners, 0)
    before = state(runners)
    runners.answer("a", data)
    assert state(runners) == before
    assert runners.counts() == {f"{fault}_frames": 1}


def test_subtick_frame_numbers_restart_with_a_new_runner() -> None:
    runners = RealTime([assignment(group("unused:A", ROWS))], 0.5, 30.0, "wait", subtick=True)
    for _ in range(2):
        join(runners, "a")
        open_tick(runners, 0)
        (_, data), *_ = runners.deliver(0, 0, received_from(broadcasts(1), [0]), NO_TX_STATUSES)
        assert decode_packets(frames.decode(data), MEASURES)[1] == 0
        runners.lose("a", "its link is gone")


def delays_of(*parts: list[int]) -> LatencySummary | None:
    lateness = LatencyHistogram()
    for part in parts:
        lateness.add(np.array(part, np.int64))
    return lateness.summary()


def test_latency_is_none_without_answers_and_zero_of_early_ones() -> None:
    assert delays_of([]) is None
    assert delays_of([-5_000_000, 0]) == LatencySummary(2, 0.0, 0.0, 0.0)


@given(st.lists(st.lists(st.integers(0, 10**14), max_size=30), min_size=1, max_size=5).filter(any))
def test_latency_percentiles_are_within_half_a_percent(parts: list[list[int]]) -> None:
    delays = delays_of(*parts)
    late_ns = np.sort([late for part in parts for late in part])
    assert delays is not None
    assert (delays.count, delays.worst_s) == (len(late_ns), late_ns[-1] / NS_PER_S)
    for share, delay_s in ((0.5, delays.p50_s), (0.99, delays.p99_s)):
        exact_s = late_ns[int(np.ceil(share * len(late_ns))) - 1] / NS_PER_S
        assert exact_s - 1e-9 <= delay_s <= min(exact_s * 1.0051 + 6e-9, delays.worst_s)
