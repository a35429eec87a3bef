import csv
import errno
import io
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from swarmwire.agent.drivers.driver import STOP, Command, DriverLost
from swarmwire.agent.on_robot.controller import Controller, group_of
from swarmwire.agent.on_robot.log import RowFile, TickRow, new_log
from swarmwire.agent.on_robot.loop import Pacer
from swarmwire.agent.on_robot.plan import SpeedLimits, limits_for
from swarmwire.agent.on_robot.states import LOST, RUNNING, STOP_REQUESTED
from swarmwire.agent.radios.radio import ReceivedPacket, SentPacket
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.errors import AgentFailed, BadInput
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.bodies.custom import CustomActuatorSpec
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets
from swarmwire.comms.wire.radio_bridge import Pose
from tests.support.agent.on_robot.robot_players import Count
from tests.support.agent.on_robot.scripted import PERIOD_NS, PLAYERS, RATE_HZ, UTC_NS, Rig, ScriptedRadio, lost
from tests.support.clocks import MS, ORIGIN_NS, FakeClock

ROBOTS = ("flock-0", "flock-1", "flock-2")
AT_NS = 1_795_000_000_000_000_123


def test_loop_steps_at_every_tick():
    rig = Rig("Driving")
    rows = rig.run(4)
    assert [row.tick for row in rows] == [0, 1, 2, 3]
    assert [row.utc_ns for row in rows] == [UTC_NS + ORIGIN_NS + tick * PERIOD_NS for tick in range(4)]
    assert not any(row.late for row in rows)
    assert rig.driver.commands == [Command(0.03, 0.5)] * 4


def test_slow_step_skips_and_counts_the_missed_ticks():
    rig = Rig("Driving")
    rig.driver.faults["sense"] = [None, rig.takes(350 * MS)]
    rows = rig.run(4)
    assert [(row.tick, row.late) for row in rows] == [(0, False), (1, False), (4, True), (5, False)]
    status = rig.loop.status()
    assert (status["late_ticks"], status["counts"]["skipped_ticks"]) == (1, 2)
    assert rig.clock.slept_until[-1] == ORIGIN_NS + 5 * PERIOD_NS


def test_radio_receives_the_time_since_the_first_tick():
    rig = Rig("Driving")
    rig.driver.faults["sense"] = [rig.takes(250 * MS)]
    rig.run(2)
    assert rig.radio.requested_ns == [250 * MS, 250 * MS]


def test_command_lasts_until_the_next_and_nan_is_ignored():
    rig = Rig("Once")
    rows = rig.run(4)
    assert rig.driver.commands == [Command(0.02, 0.0)] * 4
    assert [row.drive for row in rows] == [True, False, True, False]
    assert rig.loop.status()["counts"]["nan_commands"] == 1


def test_agent_starts_once_all_its_sensors_delivered_readings_or_after_three_seconds():
    rig, blind = (Rig("Driving", measures=(), body="epuck-gps", tracked=("compass",)) for _ in range(2))
    assert not any(row.drive for row in rig.run(3))
    rig.pose = Pose(0.0, 0.0, 1.0)
    assert [row.drive for row in rig.run(2)[3:]] == [True, True]
    rig.pose = None  # once it has begun it is told that a reading is lost
    assert rig.run(1)[-1].drive
    assert [row.tick for row in blind.run(33) if row.drive] == [31, 32]


def test_command_above_the_limits_is_scaled_by_one_factor_and_counted():
    rig = Rig("Driving", params={"linear_mps": 0.2, "angular_radps": 1.0}, limits=SpeedLimits(0.1, 2.0))
    rows = rig.run(2)
    assert rig.driver.commands == [Command(0.1, 0.5)] * 2
    assert rows[0].command == Command(0.1, 0.5)
    assert rig.loop.status()["counts"]["clipped_commands"] == 2


def two_packets_later() -> ScriptedRadio:
    """A radio that brings nothing in the first step and two packets in the second."""
    radio, received = ScriptedRadio(), Count(number=3).encode()
    radio.brings = [[], [(1, 0, received), (2, 5, received)]]
    return radio


def test_leds_notes_and_packets_reach_driver_log_and_radio():
    rig = Rig("Telling", radio=(radio := two_packets_later()))
    rows = rig.run(3)
    assert [command.leds for command in rig.driver.commands] == [{2: 0xFF0000}, {}, {}]
    assert [(row.state, row.value) for row in rows] == [("first", 1.5)] * 3
    assert [Count.decode(sent.payloads.row(0)).number for sent in radio.sent] == [0, 2, 0]
    assert [(int(sent.sender[0]), int(sent.to[0])) for sent in radio.sent] == [(0, 1)] * 3


def test_driver_reads_only_needed_sensors_and_the_battery():
    rig = Rig("Driving", measures=("proximity", "ground", "battery"), needs=("proximity",))
    rows = rig.run(1)
    assert rig.driver.requested == {"proximity", "battery"}
    assert rows[0].charge == rig.loop.status()["charge"] == 0.75


def test_tracker_poses_become_readings_and_nan_without_a_pose():
    rig = Rig("Knowing", needs=("positioning", "compass"), tracked=("positioning", "compass"))
    rig.pose = Pose(2.0, 1.0, 0.25)
    rows = rig.run(1)
    assert rig.driver.commands == [Command(0.02, 0.25)]
    rig.pose = None
    rig.run(1)
    assert [row.state for row in rows] == ["seen", "unseen"]
    assert [row.pose for row in rows] == [(2.0, 1.0, 0.25), None]
    assert rig.driver.commands[1] == Command(0.02, 0.25)  # nan is no command


def test_lost_robot_is_stopped_on_reconnection_and_its_agent_paused():
    rig = Rig("Once")
    rig.driver.faults = {"sense": [None, lost], "open": [lost, lost]}
    rows = rig.run(3)
    assert rig.driver.deeds == [Command(0.02), "open", "stop", Command(0.02), Command(0.02)]
    # 0.2 s, 0.4 s and 0.8 s of pauses after the loss at 0.1 s
    assert [(row.tick, row.late) for row in rows] == [(0, False), (16, False), (17, False)]
    counts = rig.loop.status()["counts"]
    assert (counts["driver_lost"], counts["ticks_without_driver"]) == (1, 14)
    assert "skipped_ticks" not in counts
    assert [line.partition(":")[0] for line in rig.onlooker.lines] == [
        "the robot is lost, and tried again",
        "the robot answers again",
    ]


def test_reconnection_pauses_double_up_to_two_seconds():
    rig, trials = Rig("Driving"), list[int]()
    rig.driver.faults = {"sense": [lost], "open": [lambda: trials.append(rig.clock.now_ns()) or lost()] * 6}
    rig.run(1)
    assert [(later - earlier) // MS for earlier, later in pairwise(trials)] == [400, 800, 1600, 2000, 2000]


def test_packets_are_sent_when_the_driver_is_lost_and_counted_meanwhile():
    rig = Rig("Telling", radio=(radio := two_packets_later()))
    rig.driver.faults = {"act": [lost]}
    rig.run(1)
    assert len(radio.sent) == 2
    assert rig.loop.status()["counts"]["packets_without_driver"] == 2


def test_leds_are_sent_again_after_a_reconnection():
    rig = Rig("Telling")
    rig.driver.faults = {"sense": [None, lost]}
    rig.run(3)
    assert [command.leds for command in rig.driver.commands] == [{2: 0xFF0000}, {2: 0xFF0000}, {}]


def test_end_is_not_delayed_by_a_lost_robot():
    rig = Rig("Driving")
    rig.onlooker.wait = lambda: rig.end.request("SIGTERM")
    rig.driver.faults = {"sense": [lost]}
    rig.loop.run()
    assert rig.driver.deeds == []
    assert rig.loop.status()["state"] == LOST
    (line,) = rig.onlooker.lines  # that it may go on is said once its driver is closed
    assert "the robot is lost" in line


def test_emergency_stop_is_immediate_and_permanent():
    rig = Rig("Driving")
    rig.run(2)
    assert rig.loop.status()["state"] == RUNNING
    rig.motors.control.estop()
    assert rig.driver.deeds[-1] == "stop"
    rows = rig.run(3)
    assert rig.driver.commands == [Command(0.03, 0.5)] * 2
    assert [row.command for row in rows[2:]] == [STOP] * 3
    assert not any(row.drive for row in rows[2:])
    assert rig.loop.status()["state"] == STOP_REQUESTED


def test_emergency_stop_is_in_the_status_of_an_agent_that_hangs():
    control = Rig("Driving").motors.control
    control.set_status({"state": RUNNING, "tick": 3})
    control.estop()
    assert control.status() == {"state": STOP_REQUESTED, "tick": 3}


def test_emergency_stop_overrides_a_command_in_flight():
    rig = Rig("Driving")
    rig.driver.faults = {"act": [None, rig.motors.control.estop]}
    rig.run(2)
    assert rig.driver.deeds == [Command(0.03, 0.5), "stop", Command(0.03, 0.5), "stop"]


def test_emergency_stop_outlasts_a_reconnection():
    rig = Rig("Driving")
    rig.driver.faults = {"sense": [None, lost]}
    rig.onlooker.after_step = lambda _: rig.motors.control.estop()
    rig.run(3)
    assert len(rig.driver.commands) == 1


@pytest.mark.parametrize("fails", [False, True], ids=["no connection", "a connection that breaks"])
def test_emergency_stop_out_of_reach_raises_and_applies_on_reconnection(fails):
    rig = Rig("Driving")

    def estop() -> None:
        rig.onlooker.wait = lambda: None
        rig.driver.faults = {"stop": [lost]} if fails else {}
        with pytest.raises(DriverLost):
            rig.motors.control.estop()

    rig.onlooker.wait = estop
    rig.driver.faults = {"sense": [None, lost]}
    rig.run(3)
    assert rig.driver.commands == [Command(0.03, 0.5)]
    assert rig.driver.deeds[-4:] == ["open", "stop", "stop", "stop"]
    rig.motors.control.estop()


def test_agent_error_ends_the_loop_with_its_traceback():
    rig = Rig("Failing")
    with pytest.raises(AgentFailed, match="the third step"):
        rig.run(9)
    assert len(rig.driver.commands) == 2


def test_loop_ends_after_its_duration():
    rig = Rig("Driving")
    rig.run(99, duration_s=0.45)
    assert [row.tick for row in rig.onlooker.rows] == [0, 1, 2, 3, 4]
    assert rig.end.reason == "duration"


def test_draws_belong_to_the_robot_and_its_seed():
    first, second = Rig("Drawing"), Rig("Drawing")
    for rig in (first, second):
        rig.run(5)
    assert first.driver.commands == second.driver.commands
    assert len({command.linear_mps for command in first.driver.commands}) == 5


def test_agent_that_writes_to_a_reading_fails_as_in_emulation():
    rig = Rig("Scribbling", needs=("proximity",))
    with pytest.raises(AgentFailed, match="read-only"):
        rig.run(1)


class _Oversleeping(FakeClock):
    """A clock on which whoever sleeps wakes so much later, once each."""

    def __init__(self, later_ms: list[int]) -> None:
        super().__init__()
        self._later_ms = later_ms

    def sleep_until(self, at_ns: int) -> None:
        super().sleep_until(at_ns)
        self.time_ns += self._later_ms.pop(0) * MS if self._later_ms else 0


@pytest.mark.parametrize("rate_hz", [1, 3, 7, 10, 30, 1000])
def test_pacer_meets_every_tick_at_its_start_at_any_rate(rate_hz):
    clock = FakeClock()
    pacer = Pacer(clock, rate_hz)
    ticks = [(*pacer.wait(), clock.now_ns()) for _ in range(50)]
    assert ticks == [(tick, False, ORIGIN_NS + tick_start_ns(tick, rate_hz)) for tick in range(50)]
    assert (pacer.late, pacer.skipped) == (0, 0)


def test_pacer_skips_the_tick_after_one_late_by_half_a_period():
    clock = _Oversleeping([0, 40, 0, 60, 0])
    pacer = Pacer(clock, 10)
    began = [(pacer.wait()[0], (clock.now_ns() - ORIGIN_NS) // MS) for _ in range(5)]
    assert began == [(0, 0), (1, 140), (2, 200), (3, 360), (5, 500)]
    assert (pacer.late, pacer.skipped) == (0, 1)


def test_pacer_takes_the_newest_tick_after_a_period_of_delay():
    clock = _Oversleeping([0, 310])
    pacer = Pacer(clock, 10)
    assert [pacer.wait() for _ in range(3)] == [(0, False), (4, True), (5, False)]
    assert (pacer.late, pacer.skipped) == (1, 3)


def test_pacer_resume_counts_no_late_or_skipped_ticks():
    clock = FakeClock()
    pacer = Pacer(clock, 10)
    pacer.wait()
    clock.time_ns += 340 * MS
    assert pacer.resume() == 3
    assert pacer.wait() == (4, False)
    assert (pacer.late, pacer.skipped) == (0, 0)
    assert pacer.resume() == 0


def test_custom_actuator_commands_are_counted_without_a_driver():
    body = replace(load_body("epuck2"), actuators={"arm": CustomActuatorSpec("a:Arm", {}, 3)})
    group = group_of("robot-0", 0, f"{PLAYERS}:Painting", {}, body, seed=0)
    mind = Controller(group, RATE_HZ, None, limits_for(body, None, None, ""))
    for tick in range(2):
        mind.step(tick, {}, ReceivedPackets.none(()), NO_TX_STATUSES)
    assert mind.actuations == 6


def _log(folder: Path, name: str = "flock-1"):
    return new_log(folder / "log", ROBOTS, name, "20261121T030405Z", "robot.toml")


def _broadcast(sequence: int) -> SentPacket:
    return SentPacket(AT_NS, sequence, BROADCAST, 6, 1, "sent")


def _rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as lines:
        return list(csv.DictReader(lines))


def test_log_has_all_files_and_rows_after_its_end(tmp_path):
    log = _log(tmp_path)
    log.begin({"format": 1, "name": "flock-1"})
    log.tick(TickRow(3, AT_NS, True, Pose(1.0, 2.5, -0.5), True, Command(0.05, -1.5), "search, slow", 2.5, 0.75))
    log.tick(TickRow(4, AT_NS, False, None, False, Command(), "", None, None))
    log.received(ReceivedPacket(AT_NS, 2, 7, BROADCAST, 6, 4660, latency_ns=1_500_000, distance_m=0.25, delivered=True))
    log.received(ReceivedPacket(AT_NS, 0, 8, 2, 6, 4660, latency_ns=None, distance_m=None, delivered=False))
    log.sent(SentPacket(AT_NS, 0, BROADCAST, 6, 4660, "sent"))
    log.sent(SentPacket(AT_NS, 1, 9, 600, 4660, "too_large"))
    log.end({"ended": "duration"})
    folder = tmp_path / "log" / "flock-1-20261121T030405Z"
    assert log.folder == folder
    assert json.loads((folder / "robot.json").read_text()) == {"format": 1, "name": "flock-1"}
    assert json.loads((folder / "summary.json").read_text()) == {"ended": "duration"}
    assert [list(row.values()) for row in _rows(folder / "ticks.csv")] == [
        ["3", "1795000000.000000123", "1", "1.0", "2.5", "-0.5", "1", "0.05", "-1.5", "search, slow", "2.5", "0.75"],
        ["4", "1795000000.000000123", "0", "", "", "", "0", "0.0", "0.0", "", "", ""],
    ]
    assert [list(row.values())[1:] for row in _rows(folder / "received.csv")] == [
        ["flock-2", "flock-1", "7", "", "6", "4660", "0.001500000", "0.25", "1"],
        ["flock-0", "flock-1", "8", "flock-2", "6", "4660", "", "", "0"],
    ]
    assert [list(row.values())[1:] for row in _rows(folder / "sent.csv")] == [
        ["flock-1", "0", "", "6", "4660", "sent"],
        ["flock-1", "1", "9", "600", "4660", "too_large"],
    ]


def test_log_of_a_killed_process_has_flushed_rows_and_no_summary(tmp_path):
    log = _log(tmp_path)
    log.sent(_broadcast(0))
    log.flush()
    log.sent(_broadcast(1))
    assert [row["seq"] for row in _rows(log.folder / "sent.csv")] == ["0"]
    assert (log.folder / "sent.csv").read_text().endswith("\n")
    assert _rows(log.folder / "ticks.csv") == []
    assert not (log.folder / "summary.json").exists()
    log.end({})


def test_log_folders_are_never_overwritten(tmp_path):
    logs = [_log(tmp_path) for _ in range(3)]
    assert [log.folder.name for log in logs] == [f"flock-1-20261121T030405Z{end}" for end in ("", "-2", "-3")]
    for log in logs:
        log.end({})


def test_log_folder_without_write_access_is_refused_at_the_start(tmp_path):
    (tmp_path / "log").write_text("a file")
    with pytest.raises(BadInput, match=r"robot\.toml: log: expected a folder to write to"):
        _log(tmp_path)


class _Full:
    """A disk that takes so many bytes and no more, until there is room again."""

    def __init__(self, file: RowFile, room: int) -> None:
        self._raw, self.room = file._file, room

    def write(self, data) -> int:
        if self.room <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        count = self._raw.write(data[: self.room])
        self.room -= count
        return count

    def __getattr__(self, name):
        return getattr(self._raw, name)


def test_full_disk_loses_counted_rows_and_leaves_whole_lines(tmp_path):
    file = RowFile(tmp_path / "rows.csv", ("a", "b"))
    file.write((1, "x"))
    file.flush()
    file._file = full = _Full(file, room=5)
    file.write((2, "y"))
    file.write((3, "z"))
    file.flush()
    assert file.lost_rows == 2
    assert file.fault is not None
    assert file.fault.errno == errno.ENOSPC
    assert (tmp_path / "rows.csv").read_text() == "a,b\n1,x\n"
    full.room = 100
    file.write((4, None))
    file.close()
    file.close()
    assert (file.lost_rows, file.fault) == (2, None)
    assert (tmp_path / "rows.csv").read_text() == "a,b\n1,x\n4,\n"


def test_full_disk_at_the_start_delays_the_header(tmp_path):
    file = RowFile(tmp_path / "rows.csv", ("a", "b"))
    file._file = full = _Full(file, room=0)
    for number, room in ((1, 0), (2, 100)):
        full.room = room
        file.write((number, "x"))
        file.flush()
    file.close()
    assert (file.lost_rows, (tmp_path / "rows.csv").read_text()) == (1, "a,b\n2,x\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has /dev/full, a disk that is always full")
def test_log_losses_are_counted(tmp_path):
    log = _log(tmp_path)
    log._sent._file.close()
    log._sent._file = io.FileIO("/dev/full", "wb")
    log.folder.joinpath("robot.json").mkdir()
    log.begin({})
    log.sent(_broadcast(0))
    log.flush()
    assert log.counts() == {"log_rows_lost": 1, "log_files_lost": 1}
    assert log.fault is not None
    assert log.fault.errno == errno.ENOSPC
    log.end({})
