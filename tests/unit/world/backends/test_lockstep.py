"""Runs in lockstep, and their pace."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import AgentFailed, RunnerLost
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.limits import MAX_BYTES
from swarmwire.comms.wire.tick_frames import decode_tick, encode_actions
from swarmwire.world.backends.join_policy import JoinRefused
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.backends.registry import OnLoss
from tests.support.agent.hosts import MEASURES, SILENCE, plain, readings, received_from
from tests.support.clocks import MS, ORIGIN_NS, FakeClock
from tests.support.world.locksteps import (
    FLOCK,
    GROUPS,
    SCOUTS,
    actions,
    all_readings,
    joined,
    lockstep_of_two,
    parts,
    playing_lockstep,
    ready,
    request,
    state,
    two_parts,
    valid_answer,
)

PLAYED_BY_B = "flock-4, flock-5, scouts-6, lone-7 (4 robots)"
OWNERS = st.lists(st.integers(0, 3), min_size=8, max_size=8)


@pytest.mark.parametrize(
    ("runner", "data", "name"),
    [
        ("stranger", valid_answer(), "unknown_runner"),
        ("stranger", b"", "unknown_runner"),
        ("stranger", frames.encode("failed", 4, {}, {"robots": "x", "traceback": "y"}), "unknown_runner"),
        ("a", b"", "malformed"),
        ("a", b"\xc1", "malformed"),
        ("a", valid_answer()[:-1], "malformed"),
        ("a", bytes(MAX_BYTES + 1), "oversized"),
        ("a", valid_answer("b"), "malformed"),  # robots of another
        ("a", frames.encode("actions", 4, {}), "malformed"),
        ("a", encode_actions(3, actions([0, 1, 2, 3])), "wrong_tick"),
        ("a", encode_actions(5, actions([0, 1, 2, 3])), "wrong_tick"),
        ("a", frames.encode("ready", -1, {}), "unexpected_kind"),
        ("a", frames.encode("tick", 4, {}), "unexpected_kind"),
        ("a", frames.encode("end", -1, {}), "unexpected_kind"),
        ("b", valid_answer("b"), "wrong_tick"),  # second answer
    ],
)
def test_unfit_answer_is_counted_and_changes_nothing(runner: str, data: bytes, name: str) -> None:
    lockstep = playing_lockstep()
    lockstep.open_tick(4, all_readings(), SILENCE)
    lockstep.answer("b", valid_answer("b"))
    before = state(lockstep)
    lockstep.answer(runner, data)
    assert state(lockstep) == before
    assert lockstep.counts() == {f"{name}_frames": 1}
    lockstep.answer("a", valid_answer())
    assert not lockstep.waiting


def test_runner_without_acting_robots_gets_empty_groups() -> None:
    lockstep = playing_lockstep()
    out = dict(lockstep.open_tick(0, {"flock": readings(0, [4]), "scouts": readings(0, [])}, SILENCE))
    groups, *_ = decode_tick(frames.decode(out["a"]), MEASURES, GROUPS)
    assert {name: part.rows.tolist() for name, part in groups.items()} == {"flock": [], "scouts": []}
    lockstep.answer("a", encode_actions(0, actions([])))
    lockstep.answer("b", encode_actions(0, actions([4])))
    assert lockstep.pop_actions().rows.tolist() == [4]


def test_tx_status_goes_to_the_runner_of_its_robot_in_order():
    lockstep = Lockstep(parts(dict(enumerate([1, 0, 1, 0, 2, 2, 2, 2]))))
    ready(joined(lockstep, "a", "b", "c"), "a", "b", "c")
    statuses = TxStatuses(np.array([0, 1, 1, 2, 3]), np.array([9, 2, 3, 0, 1]), np.array([0, 1, 2, 3, 4]))
    got: dict[str, list[list[int]]] = {}
    for name, frame in lockstep.open_tick(0, all_readings(), SILENCE, statuses):
        _, _, status = decode_tick(frames.decode(frame), MEASURES, GROUPS)
        got[name] = [status.row.tolist(), status.id.tolist(), status.result.tolist()]
    assert got == {"a": [[1, 1, 3], [2, 3, 1], [1, 2, 4]], "b": [[0, 2], [9, 0], [0, 3]], "c": [[], [], []]}


def test_runner_without_acting_groups_gets_no_frame_and_is_not_awaited() -> None:
    lockstep = ready(joined(Lockstep(parts({0: 0, 1: 0, 4: 0, 5: 0, 2: 1, 6: 1, 3: 1, 7: 1})), "a", "b"), "a", "b")
    frames_out = lockstep.open_tick(0, {"flock": readings(0, FLOCK)}, SILENCE)
    assert [runner for runner, _ in frames_out] == ["a"]
    assert lockstep.waiting == 1
    lockstep.answer("b", encode_actions(0, actions([])))
    assert lockstep.counts() == {"wrong_tick_frames": 1}
    lockstep.answer("a", encode_actions(0, actions(FLOCK)))
    assert lockstep.waiting == 0
    assert sorted(lockstep.pop_actions().rows.tolist()) == FLOCK
    assert lockstep.open_tick(1, {}, SILENCE) == []
    assert lockstep.waiting == 0
    assert len(lockstep.pop_actions().rows) == 0


def robot_readings(readings: Readings) -> dict[int, tuple[str, list[Any]]]:
    """Group and readings of each robot row."""
    return {
        row: (name, [values[at].tolist() for values in part.fields.values()])
        for name, part in readings.items()
        for at, row in enumerate(part.rows.tolist())
    }


@given(OWNERS, st.lists(st.integers(0, 7), unique=True), st.data())
def test_tick_split_among_runners_joins_to_the_undivided_tick(owners: list[int], acting: list[int], data: Any) -> None:
    slots = parts(dict(enumerate(owners)))
    names = [f"r{i}" for i in range(len(slots))]
    lockstep = ready(joined(Lockstep(slots), *names), *names)
    acting_groups = {"flock": FLOCK, "scouts": SCOUTS, "lone": [3, 7]}
    expected_readings = {name: readings(2, sorted(set(rows) & set(acting))) for name, rows in acting_groups.items()}
    expected = robot_readings(expected_readings)
    senders = data.draw(st.lists(st.integers(0, 7), max_size=6))
    payloads = Payloads.from_rows([bytes([s] * (s + 1)) for s in senders])
    sent = SentPackets(np.array(senders, np.int64), np.full(len(senders), -1), payloads)
    received = received_from(sent, data.draw(st.lists(st.integers(0, 7), unique=True).map(sorted)))

    out = lockstep.open_tick(2, expected_readings, received)
    assert [name for name, _ in out] == names
    tables: dict[int, Any] = {}
    packets: list[Any] = []
    answers: list[tuple[str, bytes]] = []
    for (name, frame), slot in zip(out, slots, strict=True):
        owned = {row for group in slot.groups for row in group.rows.tolist()}
        got_readings, got, _ = decode_tick(frames.decode(frame), MEASURES, GROUPS)
        assert all(part.rows.tolist() == sorted(part.rows.tolist()) for part in got_readings.values())
        rows = list(robot_readings(got_readings))
        assert set(rows) | set(got.receiver.tolist()) <= owned
        assert sorted(set(got.payload.tolist())) == list(range(len(got.payloads)))  # each that is needed, no other
        tables |= robot_readings(got_readings)
        packets += packet_rows(got)
        answers.append((name, encode_actions(2, actions(rows))))
    assert tables == expected
    assert packets == sorted(packets, key=lambda p: owners[p[0]])
    assert sorted(packets) == sorted(packet_rows(received))
    for name, answer in data.draw(st.permutations(answers)):
        lockstep.answer(name, answer)
    assert not lockstep.waiting
    assert not lockstep.counts()
    assert plain(lockstep.pop_actions()) == plain(actions(sorted(expected)))


def packet_rows(received: ReceivedPackets) -> list[Any]:
    names = ("receiver", "sender_index", "sequence", "received_at_ns")
    columns = [*(getattr(received, name) for name in names), *received.measured.values()]
    payloads = [received.payloads.row(int(p)) for p in received.payload]
    return list(zip(*(column.tolist() for column in columns), payloads, strict=True))


@pytest.mark.parametrize("opened", [False, True])
@pytest.mark.parametrize(
    ("values", "robots"),
    [
        ({"robots": "flock-4", "traceback": "Boom"}, "flock-4"),
        *((values, PLAYED_BY_B) for values in ({}, {"robots": "x"}, {"robots": 1, "traceback": "y"})),
    ],
)
def test_failed_agent_ends_the_run_with_robots_and_traceback(opened: bool, values: dict[str, Any], robots: str) -> None:
    lockstep = joined(lockstep_of_two(), "a", "b")
    if opened:
        ready(lockstep, "a", "b").open_tick(0, all_readings(), SILENCE)
    with pytest.raises(AgentFailed) as caught:
        lockstep.answer("b", frames.encode("failed", 0, {}, values))
    assert caught.value.robots == robots
    assert ("Boom" in caught.value.traceback) == (robots == "flock-4")


@pytest.mark.parametrize("on_loss", ["dead", "stand", "coast", "wait"])
def test_failed_agent_is_a_loss_if_the_run_tolerates_losses(on_loss: OnLoss) -> None:
    lockstep = ready(joined(Lockstep(two_parts(), on_loss), "a", "b"), "a", "b")
    lockstep.open_tick(0, all_readings(), SILENCE)
    agent = {"robots": "flock-4", "traceback": "Boom"}
    lockstep.answer("b", frames.encode("lost", -1, {"rows": np.array([4])}, {"process": "1", "reason": "?", **agent}))
    (loss,) = lockstep.losses
    assert (loss.runner, loss.robots, loss.traceback) == ("b/1", "flock-4", "Boom")
    lockstep.answer("b", frames.encode("failed", 0, {}, agent))  # its other robots
    assert [(loss.runner, loss.traceback) for loss in lockstep.losses[1:]] == [("b", "Boom")]


def test_lost_runner_ends_the_run_if_it_plays_robots() -> None:
    lockstep = joined(lockstep_of_two(), "a", "b")
    before = state(lockstep)
    lockstep.lose("stranger", "its link is gone")
    assert state(lockstep) == before
    with pytest.raises(RunnerLost) as caught:
        lockstep.lose("b", "its link is gone")
    assert (caught.value.runner, caught.value.robots) == ("b", PLAYED_BY_B)
    assert caught.value.reason == "its link is gone"


def test_robots_of_a_dead_runner_stand_still_and_are_not_awaited() -> None:
    lockstep = ready(joined(Lockstep(two_parts(), "dead"), "a", "b"), "a", "b")
    lockstep.open_tick(0, all_readings(), SILENCE)
    lockstep.lose("b", "its link is gone")
    assert (lockstep.waiting, lockstep.missing[0]) == (1, "a")
    for tick in range(2):
        lockstep.answer("a", encode_actions(tick, actions([0, 1, 2, 3])))
        assert not lockstep.waiting
        got = lockstep.pop_actions()
        still = got.rows > 3
        assert sorted(got.rows.tolist()) == list(range(8))
        assert got.drive[still].all()
        assert not got.linear_mps[still].any()
        assert not got.angular_radps[still].any()
        out = lockstep.open_tick(tick + 1, all_readings(tick + 1), SILENCE)
        assert [name for name, _ in out] == ["a"]
    assert [loss.runner for loss in lockstep.losses] == ["b"]
    assert lockstep.counts() == {"runners_lost": 1}
    with pytest.raises(JoinRefused, match="all robots are taken"):
        lockstep.join("c", request())


@pytest.mark.parametrize("answered", [False, True])
def test_successor_of_a_lost_runner_gets_the_open_tick(answered: bool) -> None:
    lockstep = ready(joined(Lockstep(two_parts(), "wait"), "a", "b"), "a", "b")
    out = dict(lockstep.open_tick(0, all_readings(), SILENCE))
    lockstep.answer("a", encode_actions(0, actions([0, 1, 2, 3])))
    if answered:
        lockstep.answer("b", encode_actions(0, actions([4, 5, 6, 7])))
    lockstep.lose("b", "its link is gone")
    lockstep.lose_blocking("no answer")  # no runner blocks the tick
    assert (lockstep.waiting, lockstep.missing[0], len(lockstep.losses)) == (1, "that did not join", 1)
    joined(lockstep, "c")
    again = lockstep.answer("c", frames.encode("ready", -1, {}))
    assert again == [("c", out["b"])]
    assert lockstep.waiting
    lockstep.answer("c", encode_actions(0, actions([4, 5, 6, 7])))
    assert not lockstep.waiting
    assert plain(lockstep.pop_actions()) == plain(actions(list(range(8))))
    assert [name for name, _ in lockstep.open_tick(1, all_readings(1), SILENCE)] == ["a", "c"]


@pytest.mark.parametrize("on_loss", ["dead", "wait"])
def test_loss_before_the_first_tick_ends_the_run(on_loss: Any) -> None:
    lockstep = joined(Lockstep(two_parts(), on_loss), "a")
    with pytest.raises(RunnerLost):
        lockstep.lose("a", "its link is gone")
    with pytest.raises(RunnerLost, match="no answer"):
        lockstep.lose_blocking("no answer")


def paced(factor: float = 1.0, rate_hz: int = 10) -> tuple[FakeClock, Pace, list[str]]:
    clock, reports = FakeClock(), []
    return clock, Pace(clock, rate_hz, factor, reports.append), reports


def test_pace_waits_until_the_next_tick_starts() -> None:
    clock, pace, reports = paced(factor=4.0, rate_hz=3)
    for tick in range(3):
        pace.begin()
        clock.time_ns += 5 * MS
        pace.wait(tick)
    starts = [round(tick * NS_PER_S // 3 / 4.0) for tick in (1, 2, 3)]
    assert clock.slept_until == [ORIGIN_NS + start for start in starts]
    assert (pace.missed_ticks, pace.worst_lag_ns, reports) == (0, 0, [])


def test_pace_does_not_wait_while_the_loop_lags() -> None:
    clock, pace, reports = paced()
    lags_ms = []
    for tick, work_ms in enumerate([250, 10, 10, 10]):
        pace.begin()
        clock.time_ns += work_ms * MS
        waits = len(clock.slept_until)
        pace.wait(tick)
        lags_ms.append(len(clock.slept_until) == waits)
    assert lags_ms == [True, True, False, False]
    assert clock.slept_until == [ORIGIN_NS + 300 * MS, ORIGIN_NS + 400 * MS]
    assert (pace.missed_ticks, pace.worst_lag_ns) == (2, 150 * MS)
    assert len(reports) == 1
    assert "does not keep up with 1 x real time: at tick 0 the loop is 150.0 ms behind" in reports[0]


def test_pace_reports_a_lag_at_once_and_then_every_five_seconds() -> None:
    clock, pace, reports = paced()
    for tick in range(60):  # 12 s of wall time
        pace.begin()
        clock.time_ns += 200 * MS
        pace.wait(tick)
    assert pace.missed_ticks == 60
    assert [text.split("at tick ")[1].split()[0] for text in reports] == ["0", "25", "50"]


def test_pace_restart_forgets_lag_and_pause() -> None:
    clock, pace, reports = paced()
    pace.begin()
    pace.wait(0)
    clock.time_ns += 3600 * NS_PER_S
    pace.restart(1, 2.0, 3600 * NS_PER_S)
    assert pace.begin() == ORIGIN_NS + 100 * MS  # time without the pause
    pace.wait(1)
    pace.wait(2)
    assert [at_ns - ORIGIN_NS - 3600 * NS_PER_S for at_ns in clock.slept_until[1:]] == [150 * MS, 200 * MS]
    assert (pace.missed_ticks, reports) == (0, [])


def test_pace_restarts_after_a_freeze_within_a_tick() -> None:
    clock, pace, reports = paced()
    pace.begin()
    pace.wait(0)
    clock.time_ns += 3600 * NS_PER_S  # Ctrl-Z within tick 1
    pace.wait(1)
    assert pace.begin() == ORIGIN_NS + 200 * MS  # watchdogs, which measure by it, do not count the pause
    pace.wait(2)
    assert [at_ns - ORIGIN_NS - 3600 * NS_PER_S for at_ns in clock.slept_until[1:]] == [200 * MS]
    assert (pace.missed_ticks, pace.lag_ns, pace.worst_lag_ns) == (1, 0, 3600 * NS_PER_S - 100 * MS)
    assert reports == ["real time: the loop stalled for 3599.9 s in tick 1; the schedule restarts from there"]


def test_pace_restarts_after_a_freeze_within_its_sleep() -> None:
    clock, pace, reports = paced()
    pace.begin()
    clock.sleep_until = lambda at_ns: setattr(clock, "time_ns", at_ns + 60 * NS_PER_S)
    pace.wait(0)
    assert pace.end_ns(1) == clock.time_ns + 100 * MS
    assert reports == ["real time: the loop stalled for 60.0 s in tick 0; the schedule restarts from there"]
