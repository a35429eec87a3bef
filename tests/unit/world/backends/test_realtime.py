"""Runs in real time."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import RunnerLost
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
from tests.support.agent.hosts import MEASURES, assignment, group, one_group, received_from
from tests.support.clocks import FakeClock

ROWS = [0, 1, 2, 3]
OWN = {"a": [0, 2], "b": [1, 3]}
TICK_NS = NS_PER_S // 10  # wall time, at factor 1


def join(runners: RealTime, name: str) -> None:
    runners.join(name, JoinRequest().encode())
    runners.answer(name, frames.encode("ready", -1, {}))


def playing(on_loss: OnLoss = "stop", timeout_s: float = 30.0) -> RealTime:
    runners = RealTime([assignment(group("unused:A", own)) for own in OWN.values()], 0.5, timeout_s, on_loss)
    for name in OWN:
        join(runners, name)
    return runners


def opened(runners: RealTime, tick: int, received: ReceivedPackets | None = None, rows: list[int] = ROWS) -> list[str]:
    out = runners.open_tick(
        tick, tick * TICK_NS, one_group(tick, rows), ReceivedPackets.none(MEASURES) if received is None else received
    )
    return [name for name, _ in out]


def said(runner: str, tick: int, speed: float, drive: bool = True) -> bytes:
    """An answer that commands `speed` and sends a packet from each robot that tells the tick."""
    rows = np.array(OWN[runner], np.int64)
    sent = SentPackets(rows, np.full(len(rows), BROADCAST), Payloads.from_rows([bytes([0, 0, tick])] * len(rows)))
    n = len(rows)
    return encode_actions(
        tick, Actions(rows, np.full(n, drive), np.full(n, speed), np.full(n, -speed), np.zeros(n), sent)
    )


def taken(runners: RealTime) -> tuple[dict[int, float], list[int]]:
    """The new commands by robot, and the ticks that the packets tell."""
    got = runners.pop_actions()
    commands = {int(row): float(v) for row, v in zip(got.rows[got.drive], got.linear_mps[got.drive], strict=True)}
    assert (got.angular_radps == -got.linear_mps).all()
    return commands, [got.sent.payloads.row(i)[2] for i in range(len(got.sent))]


def state(runners: RealTime) -> Any:
    slots = [(slot.runner, slot.state, list(slot.unanswered)) for slot in runners._allocations]
    arrays = (runners._pending_since_ns, runners._stopped, runners._drive, runners._command, runners.late)
    return slots, [array.tolist() for array in arrays], len(runners._sent), runners.frames_dropped


def test_answers_within_their_tick_are_commands_of_that_tick() -> None:
    runners = playing()
    for tick in range(3):
        assert opened(runners, tick) == ["a", "b"]
        for name in ("b", "a"):
            runners.answer(name, said(name, tick, tick + 0.5))
        assert taken(runners) == (dict.fromkeys(ROWS, tick + 0.5), [tick] * 4)
    assert not runners.counts()
    assert not runners.late.any()
    assert (runners.frames_dropped, runners.packets_dropped) == (0, 0)


def test_the_loop_does_not_wait_and_a_late_answer_applies_and_sends_when_it_comes() -> None:
    runners = playing()
    opened(runners, 0)
    runners.answer("b", said("b", 0, 1.0))
    assert taken(runners) == ({1: 1.0, 3: 1.0}, [0, 0])
    opened(runners, 1)
    runners.answer("a", said("a", 0, 2.0))
    assert taken(runners) == ({0: 2.0, 2: 2.0}, [0, 0])
    assert runners.late.tolist() == [1, 0, 1, 0]
    assert taken(runners) == ({}, [])  # once


def test_of_two_answers_in_a_tick_the_newer_commands_and_both_send() -> None:
    runners = playing()
    opened(runners, 0)
    opened(runners, 1)
    runners.answer("a", said("a", 0, 1.0))
    runners.answer("a", said("a", 1, 2.0))
    assert taken(runners) == ({0: 2.0, 2: 2.0}, [0, 0, 1, 1])
    assert runners.late.tolist() == [1, 0, 1, 0]
    opened(runners, 2)
    opened(runners, 3)
    runners.answer("a", said("a", 2, 3.0))
    runners.answer("a", said("a", 3, 9.0, drive=False))  # it has no new command: the one before holds
    assert taken(runners)[0] == {0: 3.0, 2: 3.0}


@pytest.mark.parametrize("rows", [[0, 0], [1], [7]])
def test_a_partial_answer_has_own_robots_each_once(rows: list[int]) -> None:
    runners = playing()
    opened(runners, 0)
    zeros = np.zeros(len(rows))
    runners.answer("a", encode_actions(0, Actions(np.array(rows), zeros.astype(bool), zeros, zeros, zeros)))
    assert runners.counts() == {"malformed_frames": 1}
    runners.answer("a", said("a", 0, 1.0))
    assert taken(runners)[0] == {0: 1.0, 2: 1.0}


def test_leds_switched_in_answers_between_two_takes_are_all_switched_and_the_newer_colour_counts() -> None:
    runners = playing()
    opened(runners, 0)
    opened(runners, 1)
    for tick, (changed, place, rgb) in enumerate((([0, 2], [3, 3], [7.0, 8.0]), ([2, 2], [3, 4], [9.0, 10.0]))):
        rows = np.array(OWN["a"], np.int64)
        still = np.zeros(len(rows))
        leds = SparseTable(np.array(changed), np.array(place), np.array(rgb))
        actions = Actions(rows, still.astype(bool), still, still, still, leds=leds)
        runners.answer("a", encode_actions(tick, actions))
    got = runners.pop_actions().leds
    assert (got.rows.tolist(), got.slot.tolist(), got.value.tolist()) == ([0, 2, 2, 2], [3, 3, 3, 4], [7, 8, 9, 10])
    assert len(runners.pop_actions().leds) == 0


def test_of_two_numbers_told_in_answers_between_two_takes_the_newer_comes_last() -> None:
    runners = playing()
    opened(runners, 0)
    opened(runners, 1)
    rows = np.array(OWN["a"], np.int64)
    still = np.zeros(len(rows))
    place = np.zeros_like(rows)
    tables = SparseTable(rows, place, still + 0.5), SparseTable(rows[1:], place[1:], still[1:] + 0.75)
    for tick, told in enumerate(tables):
        runners.answer("a", encode_actions(tick, Actions(rows, still.astype(bool), still, still, still, values=told)))
    got = runners.pop_actions().values
    assert (got.rows.tolist(), got.value.tolist()) == ([*OWN["a"], *OWN["a"][1:]], [0.5, 0.5, 0.75])
    assert len(runners.pop_actions().values) == 0


def test_a_speed_sideways_crosses_with_the_others_and_who_is_stopped_has_none() -> None:
    runners = playing()
    rows = np.array(OWN["a"], np.int64)
    some = np.full(len(rows), 0.5)
    for tick, expected in ((0, 1.0), (1, 0.0)):
        opened(runners, tick)
        runners.answer("a", encode_actions(tick, Actions(rows, some.astype(bool), some, some, 2.0 * some)))
        if tick:
            runners._stop(rows)
        assert runners.pop_actions().lateral_mps[rows].tolist() == [expected] * len(rows)


@pytest.mark.parametrize("tick", [0, 1, 2, 4])
def test_an_answer_that_is_not_newer_or_was_not_asked_for_changes_nothing(tick: int) -> None:
    runners = playing()
    for asked in range(4):
        opened(runners, asked)
        if asked == 2:
            runners.answer("a", said("a", 2, 1.0))
    before = state(runners)
    runners.answer("a", said("a", tick, 5.0))
    assert state(runners) == before
    assert runners.counts() == {"wrong_tick_frames": 1}


@pytest.mark.parametrize("data", [b"", b"\xc1", said("b", 0, 1.0), frames.encode("actions", 0, {})])
def test_what_is_malformed_changes_nothing(data: bytes) -> None:
    runners = playing()
    opened(runners, 0)
    before = state(runners)
    runners.answer("a", data)
    assert state(runners) == before
    assert runners.counts() == {"malformed_frames": 1}


def test_frames_that_were_passed_over_are_dropped_with_what_was_received_in_them() -> None:
    runners = playing()
    sent = SentPackets(np.array([1]), np.array([BROADCAST]), Payloads.from_rows([b"xyz"]))
    opened(runners, 0, received_from(sent, [0, 2, 3]))  # two packets to a, one to b
    opened(runners, 1, received_from(sent, [0]))
    opened(runners, 2, received_from(sent, [2]))
    runners.answer("a", said("a", 2, 1.0))
    assert (runners.frames_dropped, runners.packets_dropped) == (2, 3)
    assert not runners.late.any()
    runners.answer("b", said("b", 0, 1.0))
    assert (runners.frames_dropped, runners.packets_dropped) == (2, 3)


def test_tx_status_in_frames_that_were_passed_over_are_counted() -> None:
    runners = playing()
    told = TxStatuses(np.array([0, 0, 2]), np.array([0, 1, 0]), np.array([0, 1, 0]))
    for tick in range(2):
        runners.open_tick(tick, tick * TICK_NS, one_group(tick, ROWS), ReceivedPackets.none(MEASURES), told)
    assert runners.tx_status_dropped == 0
    owned = sum(row in OWN["a"] for row in told.row.tolist())
    runners.answer("a", said("a", 1, 1.0))
    assert (runners.frames_dropped, runners.tx_status_dropped) == (1, owned)


def test_a_robot_without_answers_keeps_its_command_until_the_watchdog_stops_it_once() -> None:
    runners = playing()
    for tick in range(12):
        opened(runners, tick)
        if tick == 0:
            runners.answer("a", said("a", 0, 1.0))
        runners.answer("b", said("b", tick, 1.0))
        commands, _ = taken(runners)
        # a is asked in vain from tick 1, at 0.1 s; 0.5 s later it stops, and is told so once.
        assert commands.get(0) == {0: 1.0, 6: 0.0}.get(tick)
        assert commands[1] == 1.0
    assert runners.watchdog_stops.tolist() == [1, 0, 1, 0]


def test_fresh_commands_let_it_go_on_and_the_watchdog_begins_anew() -> None:
    runners = playing()
    for tick in range(20):
        opened(runners, tick)
        if tick == 8:
            runners.answer("a", said("a", 7, 2.0))  # a late one is fresh, too
        commands, _ = taken(runners)
        assert commands.get(0) == {5: 0.0, 8: 2.0, 14: 0.0}.get(tick)
    assert runners.watchdog_stops.tolist() == [2, 1, 2, 1]
    assert runners.late.tolist() == [1, 0, 1, 0]


def test_a_robot_that_is_seldom_asked_is_not_stopped_for_it() -> None:
    runners = playing()
    for tick in range(30):
        opened(runners, tick, rows=ROWS if tick % 10 == 0 else [])
        runners.answer("a", said("a", tick, 1.0)) if tick % 10 == 0 else None
        taken(runners)
    assert runners.watchdog_stops.tolist() == [0, 1, 0, 1]


def test_a_lost_runner_ends_the_run_if_it_should() -> None:
    runners = playing("stop")
    opened(runners, 0)
    with pytest.raises(RunnerLost, match="its link is gone"):
        runners.lose("a", "its link is gone")


@pytest.mark.parametrize("on_loss", ["stop", "dead", "wait"])
def test_before_the_first_tick_every_loss_ends_the_run(on_loss: OnLoss) -> None:
    with pytest.raises(RunnerLost):
        playing(on_loss).lose("a", "its link is gone")


def test_robots_of_a_dead_runner_stand_still_to_the_end() -> None:
    runners = playing("dead")
    opened(runners, 0)
    runners.answer("a", said("a", 0, 1.0))
    runners.lose("a", "its link is gone")
    assert taken(runners)[0] == {0: 0.0, 2: 0.0}
    for tick in range(1, 9):
        assert opened(runners, tick) == ["b"]
        runners.answer("a", said("a", 0, 1.0))
        runners.answer("b", said("b", tick, 1.0))
        assert taken(runners)[0] == {1: 1.0, 3: 1.0}
    assert [str(loss) for loss in runners.losses] == ["a, which played flock-0, flock-2: its link is gone"]
    assert runners.counts() == {"runners_lost": 1, "unknown_runner_frames": 8}
    assert not runners.watchdog_stops.any()


def test_another_runner_takes_over_and_the_watchdog_lets_its_robots_go_on() -> None:
    runners = playing("wait")
    for tick in range(12):
        names = opened(runners, tick)
        assert names == (["b"] if 2 < tick < 10 else ["c" if tick >= 10 else "a", "b"])
        for name in names:
            runners.answer(name, said("a" if name == "c" else name, tick, 1.0))
        if tick == 2:
            runners.lose("a", "its link is gone")
        if tick == 9:
            join(runners, "c")
        assert taken(runners)[0].get(0) == (0.0 if tick == 8 else 1.0 if not 2 < tick < 10 else None)


def test_a_runner_that_is_silent_for_too_long_is_lost() -> None:
    runners = playing("dead", timeout_s=1.0)
    for tick in range(12):
        opened(runners, tick)
        runners.answer("b", said("b", tick, 1.0))
        assert len(runners.losses) == (tick > 10)  # asked at 0.0 s
    assert runners.losses[0].reason == "no answer for 1 s"


def test_health_counts_runners_and_what_they_missed() -> None:
    runners = playing("dead")
    assert runners.health() == RunnerHealth(ready=2, lost=0)
    for tick in range(7):
        opened(runners, tick)
        runners.answer("a", said("a", tick, 1.0))
        taken(runners)
    runners.answer("b", said("b", 5, 1.0))
    assert runners.health() == RunnerHealth(2, 0, late_answers=2, frames_dropped=5, watchdog_stops=2)
    runners.lose("a", "its link is gone")
    assert (runners.health().ready, runners.health().lost) == (1, 1)


def test_a_pause_loses_no_runner_and_stops_no_robot_and_an_answer_from_before_it_counts() -> None:
    clock, pause_ns = FakeClock(), 3600 * NS_PER_S
    pace = Pace(clock, 10, 1.0, lambda _: None)
    runners = playing("dead", timeout_s=1.0)
    runners.open_tick(0, pace.begin(), one_group(0, ROWS), ReceivedPackets.none(MEASURES))
    pace.wait(0)
    assert taken(runners) == ({}, [])
    clock.time_ns += pause_ns
    pace.restart(1, 1.0, pause_ns)
    runners.open_tick(1, pace.begin(), one_group(1, ROWS), ReceivedPackets.none(MEASURES))
    assert not runners.losses
    for name in OWN:
        runners.answer(name, said(name, 0, 1.0))
    assert taken(runners) == (dict.fromkeys(ROWS, 1.0), [0] * 4)
    assert not runners.watchdog_stops.any()
    clock.time_ns += 2 * NS_PER_S  # not a pause: a loop that lags
    runners.open_tick(2, pace.begin(), one_group(2, ROWS), ReceivedPackets.none(MEASURES))
    assert [loss.reason for loss in runners.losses] == ["no answer for 1 s"] * 2


def in_subticks() -> RealTime:
    parts = [assignment(group("unused:A", own)) for own in OWN.values()]
    runners = RealTime(parts, 0.5, 30.0, "dead", subtick=True)
    for name in OWN:
        join(runners, name)
    return runners


def word(*senders: int) -> SentPackets:
    return SentPackets(
        np.array(senders), np.full(len(senders), BROADCAST), Payloads.from_rows([bytes(3)] * len(senders))
    )


def test_in_subticks_each_ready_runner_gets_what_its_robots_received_and_numbers_tell_what_it_missed() -> None:
    runners = in_subticks()
    opened(runners, 0)
    told = TxStatuses(np.array([3]), np.array([0]), np.array([1]))
    for number in range(2):
        out = dict(runners.deliver(0, 5_000_000, received_from(word(1), [0, 2]), told))
        assert list(out) == ["a", "b"]
        at_ns, got, received, tx_status = decode_packets(frames.decode(out["a"]), MEASURES)
        assert (at_ns, got, received.receiver.tolist(), len(tx_status)) == (5_000_000, number, [0, 2], 0)
        _, _, nothing, tx_status = decode_packets(frames.decode(out["b"]), MEASURES)
        assert (len(nothing), tx_status.row.tolist()) == (0, [3])
    assert runners.deliver(0, 6_000_000, ReceivedPackets.none(MEASURES), TxStatuses(*np.empty((3, 0), np.int64))) == []


def test_in_subticks_packets_of_robots_without_a_runner_are_counted_as_dropped() -> None:
    runners = RealTime([assignment(group("unused:A", own)) for own in OWN.values()], 0.5, 30.0, "wait", subtick=True)
    join(runners, "a")
    assert [name for name, _ in runners.deliver(0, 0, received_from(word(0), [1, 2, 3]), NO_TX_STATUSES)] == ["a"]
    assert runners.packets_dropped == 2


def test_in_subticks_what_comes_is_given_with_its_time_and_whether_it_is_of_a_step() -> None:
    runners = in_subticks()
    opened(runners, 0)
    runners.now_ns = 5
    runners.answer("b", said("b", 0, 1.0))
    runners.now_ns = 7
    runners.answer("a", encode_sent(0, word(2), missed=3))
    puts = runners.pop_sent()
    assert [(put.at_ns, put.tick, put.sent.sender.tolist()) for put in puts] == [(5, 0, [1, 3]), (7, None, [2])]
    assert runners.pop_sent() == []
    commands, sent = taken(runners)
    assert (commands, sent) == ({1: 1.0, 3: 1.0}, [])
    assert runners.counts() == {"packets_frames_missed_by_runners": 3}


def test_a_sent_frame_is_taken_of_ones_own_robots_alone_and_without_subticks_not_at_all() -> None:
    for runners, data, fault in (
        (in_subticks(), encode_sent(0, word(1)), "malformed"),
        (in_subticks(), frames.encode("sent", 0, {}), "malformed"),
        (playing(), encode_sent(0, word(2)), "unexpected_kind"),
    ):
        opened(runners, 0)
        before = state(runners)
        runners.answer("a", data)
        assert state(runners) == before
        assert runners.counts() == {f"{fault}_frames": 1}


def test_numbers_of_frames_begin_anew_with_a_new_runner() -> None:
    runners = RealTime([assignment(group("unused:A", ROWS))], 0.5, 30.0, "wait", subtick=True)
    for _ in range(2):
        join(runners, "a")
        opened(runners, 0)
        (_, data), *_ = runners.deliver(0, 0, received_from(word(1), [0]), NO_TX_STATUSES)
        assert decode_packets(frames.decode(data), MEASURES)[1] == 0
        runners.lose("a", "its link is gone")


def delays_of(*parts: list[int]) -> LatencySummary | None:
    lateness = LatencyHistogram()
    for part in parts:
        lateness.add(np.array(part, np.int64))
    return lateness.summary()


def test_of_nothing_there_are_no_delays() -> None:
    assert delays_of([]) is None


def test_what_came_early_was_on_time() -> None:
    assert delays_of([-5_000_000, 0]) == LatencySummary(2, 0.0, 0.0, 0.0)


@given(st.lists(st.lists(st.integers(0, 10**14), max_size=30), min_size=1, max_size=5).filter(any))
def test_percentiles_are_within_half_a_percent_and_never_above_the_worst(parts: list[list[int]]) -> None:
    found = delays_of(*parts)
    late_ns = np.sort([late for part in parts for late in part])
    assert found is not None
    assert (found.count, found.worst_s) == (len(late_ns), late_ns[-1] / NS_PER_S)
    for share, told_s in ((0.5, found.p50_s), (0.99, found.p99_s)):
        exact_s = late_ns[int(np.ceil(share * len(late_ns))) - 1] / NS_PER_S
        assert exact_s - 1e-9 <= told_s <= min(exact_s * 1.0051 + 6e-9, found.worst_s)
