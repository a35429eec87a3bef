import json
import os
import re
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest

from swarmwire.agent import cli
from swarmwire.agent.drivers.driver import Command
from swarmwire.agent.on_robot.log import TickRow, new_log
from swarmwire.agent.on_robot.network_check import LivenessWatch
from swarmwire.agent.on_robot.reporting import NOT_STARTED, RobotObservers, StatusFile, Terminal, short, status_path
from swarmwire.agent.on_robot.safety import Control
from swarmwire.comms.base.clock import NS_PER_S, to_ns
from swarmwire.comms.wire.radio_bridge import Pose
from tests.support.agent.on_robot.installed import DRIVING, deeds, install, robot_flags
from tests.support.agent.on_robot.scripted import PERIOD_NS, PLAYERS, UTC_NS, DatedFakeClock
from tests.support.clocks import FakeClock, until

ORIGIN = Pose(0.0, 0.0, 0.0)
REFUSED = {
    "--rate-hz 0": "--rate-hz: expected at least 1 Hz, got 0",
    "--watchdog-s 0.1": "--watchdog-s: expected more than a period of --rate-hz, 0.1 s",
    "--param linear=1": "--param linear: unknown parameter of Driving",
    "--param linear_mps=fast": "--param linear_mps: expected a number, got 'fast'",
    "--param linear_mps": "--param: expected a name and its value",
    "--option gonne=true": "--option gonne: unknown key; expected one of gone (did you mean this?)",
    "--body mine.toml": "--body: expected a readable file",
    "--address nowhere": "--address: expected the path of a file; got 'nowhere'",
    "--driver lacking": "install written-driver[lacking]",
    "--radio zenoh": "command line: --listen: expected --listen, --connect or --multicast, which radio",
    "--duration-s 0": "--duration-s: expected more than 0 s, got 0",
}


class _Watched(Terminal):
    """A terminal that somebody watches; what it shows is kept."""

    def __init__(self) -> None:
        super().__init__("robot-0")
        self._is_terminal = True


class _Set:
    """Onlookers of a robot whose status is `status`."""

    def __init__(self, folder: Path, pace: float = 1.0) -> None:
        self.clock = DatedFakeClock()
        self.log = new_log(folder / "log", ("robot-0",), "robot-0", "now", "robot.toml")
        self.file = folder / "status.json"
        self.control = Control(lambda: None)
        self.status = {**NOT_STARTED, "state": "running", "counts": {"clipped_commands": 3}}
        self.onlookers = RobotObservers(
            self.clock, pace, _Watched(), StatusFile(self.file), self.control, {"name": "robot-0"}, self.log
        )
        self.onlookers.attach(lambda: self.status)

    def steps(self, n: int) -> None:
        for _ in range(n):
            tick = self.onlookers.steps
            self.status = {**self.status, "tick": tick}
            self.clock.time_ns += PERIOD_NS
            self.onlookers.step(TickRow(tick, 0, False, None, True, Command(), "", None, None))

    @property
    def written(self) -> dict[str, object]:
        return json.loads(self.file.read_text())

    @property
    def summary(self) -> dict[str, object]:
        return json.loads((self.log.folder / "summary.json").read_text())


def test_log_and_status_are_written_once_a_second(tmp_path):
    looking = _Set(tmp_path)
    looking.steps(9)
    assert (looking.log.folder / "ticks.csv").read_text() == ""
    assert looking.written["tick"] == -1
    looking.steps(1)
    assert len((looking.log.folder / "ticks.csv").read_text().splitlines()) == 11
    assert (looking.written["name"], looking.written["tick"]) == ("robot-0", 9)
    assert looking.written["utc_ns"] == UTC_NS + looking.clock.now_ns()
    assert looking.control.status() == looking.written
    looking.onlookers.end("duration")


def test_status_before_the_loop_is_starting(tmp_path):
    clock, control, file = DatedFakeClock(), Control(lambda: None), StatusFile(tmp_path / "status.json")
    RobotObservers(clock, 1.0, Terminal("robot-0"), file, control, {"name": "robot-0"}, None)
    assert (control.status()["name"], control.status()["state"]) == ("robot-0", "starting")


def test_network_check_is_called_once_a_second(tmp_path):
    looking, looks = _Set(tmp_path), list[int]()
    looking.onlookers.check_network = lambda: looks.append(looking.onlookers.steps)
    looking.steps(25)
    assert looks == [10, 20]
    looking.onlookers.end("duration")


def test_report_interval_is_wall_time_at_any_pace(tmp_path):
    looking = _Set(tmp_path, pace=10.0)
    looking.steps(99)
    assert looking.written["tick"] == -1
    looking.steps(1)
    assert looking.written["tick"] == 99
    looking.onlookers.end("duration")


def test_status_is_written_without_steps(tmp_path):
    looking = _Set(tmp_path)
    looking.status["state"] = "driver lost"
    looking.clock.time_ns += 10 * PERIOD_NS
    looking.onlookers.wait()
    assert looking.written["state"] == "driver lost"
    looking.onlookers.end("SIGTERM")


def test_terminal_shows_status_every_five_seconds_and_a_summary(tmp_path, capsys):
    looking = _Set(tmp_path)
    looking.steps(120)
    looking.onlookers.end("duration")
    assert capsys.readouterr().out.splitlines() == [
        "robot-0: running, tick 49",
        "robot-0: running, tick 99",
        "robot-0: ended (duration) after 120 steps; clipped_commands 3",
    ]


def test_end_is_in_the_last_status_and_the_summary(tmp_path):
    looking = _Set(tmp_path)
    looking.steps(3)
    looking.onlookers.end("SIGTERM")
    assert (looking.written["state"], looking.written["ended"]) == ("ended", "SIGTERM")
    expected = {"ended": "SIGTERM", "ticks": 3, "late_ticks": 0, "watchdog_stops": 0, "counts": {"clipped_commands": 3}}
    assert looking.summary == expected


def test_emergency_stop_is_reported_at_once_in_status_and_summary(tmp_path, capsys):
    looking = _Set(tmp_path)
    looking.steps(12)
    looking.control.estop()
    looking.control.estop()
    error = until(lambda: capsys.readouterr().err)
    assert error.startswith("robot-0: emergency stop at step 12: ")
    assert error.count("\n") == 1
    looking.steps(10)
    assert (looking.written["state"], looking.written["emergency_stop_at"]) == ("estop", 12)
    looking.onlookers.end("SIGINT")
    assert "stopped by an emergency stop at step 12, after 22 steps" in capsys.readouterr().out
    assert looking.summary["emergency_stop_at"] == 12


def test_watchdog_stop_is_reported_at_once(tmp_path, capsys):
    looking = _Set(tmp_path)
    looking.onlookers.report_silence(0.512)
    assert until(lambda: capsys.readouterr().err).startswith("robot-0: watchdog: no heartbeat of the agent for 0.51 s")
    looking.onlookers.end("duration")


def test_failure_is_reported_with_its_cause_and_not_as_no_faults(tmp_path, capsys):
    looking = _Set(tmp_path)
    looking.status["counts"] = {}
    looking.onlookers.end("no driver", "nobody answers")
    assert capsys.readouterr().out == "robot-0: ended (no driver: nobody answers) after 0 steps\n"


def test_log_write_error_is_reported_once_without_stopping_the_robot(tmp_path, capsys, monkeypatch):
    looking = _Set(tmp_path)

    def full(_: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(looking.log._ticks, "_append", full)
    looking.steps(30)
    looking.onlookers.end("duration")
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("robot-0: the log cannot be written")
    assert looking.written["counts"] == {"clipped_commands": 3, "log_rows_lost": 30}


def test_clock_change_is_reported_and_counted_unlike_synchronisation(tmp_path, capsys):
    looking = _Set(tmp_path)
    for set_by_s in (0.0, 0.01, -3.24, -3.24):
        looking.clock.set_by_ns = to_ns(set_by_s)
        looking.steps(10)
    looking.onlookers.end("duration")
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("robot-0: the clock was set by -3.250 s")
    assert looking.written["counts"] == {"clipped_commands": 3, "clock_set": 1}


def test_status_write_error_is_counted(tmp_path):
    looking = _Set(tmp_path)
    looking.file.unlink()
    looking.file.mkdir()
    looking.steps(10)
    assert looking.control.status()["counts"] == {"clipped_commands": 3}
    looking.steps(10)
    assert looking.control.status()["counts"] == {"clipped_commands": 3, "status_lost": 1}
    looking.onlookers.end("duration")


def test_status_path_is_the_log_folder_or_the_runtime_folder(monkeypatch):
    assert status_path("/logs", "flock-3") == Path("/logs/flock-3-status.json")
    monkeypatch.setenv("XDG_RUNTIME_DIR", "/run/user/1000")
    assert status_path("", "flock-3") == Path("/run/user/1000/swarmwire/flock-3/status.json")
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    assert status_path("", "flock-3") is None


def test_terminal_loss_does_not_stop_the_robot(monkeypatch):
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as out:
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr(sys, "stderr", out)
        terminal = Terminal("robot-0")
        terminal.begin("what runs")
        terminal.report("something")
    terminal.report("to a file that is closed")


@pytest.mark.parametrize(
    ("change", "end"),
    [
        ({}, ""),
        ({"agent_state": "search"}, ", search"),
        ({"late_ticks": 2}, ", 2 late"),
        ({"charge": 0.5}, ", battery 50 %"),
    ],
)
def test_status_line_has_the_known_values(change, end):
    status = {"state": "running", "tick": 600, "agent_state": "", "late_ticks": 0, "charge": None, **change}
    assert short(status) == f"running, tick 600{end}"


class _Swarm:
    """What a robot among k-1 and k-2 hears and sees, looked at once a second."""

    def __init__(self, pace: float = 1.0) -> None:
        self.clock, self.lines, self.received = FakeClock(), list[str](), set[str]()
        self.pose: Pose | None = None
        others = ("k-1", "k-2")
        self.presence = LivenessWatch(
            self.clock, self.lines.append, others, lambda: self.received, lambda: self.pose, pace
        )

    def seconds(self, n: int) -> list[str]:
        """What it says in so many seconds."""
        self.lines.clear()
        for _ in range(n):
            self.clock.time_ns += NS_PER_S
            self.presence.check()
        return list(self.lines)


def test_missing_robots_are_reported_after_five_seconds_and_on_arrival():
    swarm = _Swarm()
    swarm.pose = ORIGIN
    assert swarm.seconds(4) == []
    assert swarm.seconds(10) == ["radio: no packets from any of k-1, k-2"]
    for robot in ("k-2", "k-1"):
        swarm.received.add(robot)
        assert swarm.seconds(3) == [f"radio: first packets from {robot}"]
    partly = _Swarm()
    partly.pose, partly.received = ORIGIN, {"k-1"}
    assert partly.seconds(9) == ["radio: no packets from k-2"]
    assert _Swarm(pace=10.0).seconds(49) == []  # the timeout is wall time


def test_missing_poses_are_reported_and_counted_and_their_return():
    swarm = _Swarm()
    swarm.received = {"k-1", "k-2"}
    assert swarm.seconds(9) == ["tracker: no pose of this robot for 5 s"]
    swarm.pose = ORIGIN
    assert swarm.seconds(9) == ["tracker: receives poses again"]
    assert swarm.presence.counts() == {"seconds_without_pose": 9}
    swarm.pose = None
    assert swarm.seconds(4) == []
    assert swarm.seconds(1) == ["tracker: no pose of this robot for 5 s"]
    assert swarm.presence.counts() == {"seconds_without_pose": 14}


@pytest.fixture
def installed(tmp_path, monkeypatch) -> Iterator[Path]:
    """Where the robot writes what it is asked; its driver is found in this process, too."""
    folder = tmp_path / "installed"
    install(folder)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    yield tmp_path / "deeds"
    sys.modules.pop("written_driver", None)


def _settings(folder: Path, file: Path, more: str = "") -> Path:
    settings = folder / "robot.toml"
    settings.write_text(
        f'format = 1\nname = "flock-0"\nagent = "{DRIVING}"\n'
        f'driver = {{ name = "written", address = "{file}" }}\n{more}'
    )
    return settings


def test_help_has_an_example(capsys):
    for arguments in (["--help"], ["run", "--help"], ["stop-motors", "--help"], ["drivers", "--help"]):
        with pytest.raises(SystemExit) as ended:
            cli.main(arguments)
        assert ended.value.code == 0
    output = capsys.readouterr().out
    for text in ("swarmwire-agent run avoid.py:Avoid --driver epuck2", "exit codes: 0 it ended", "--duration-s S"):
        assert text in output


def test_version_is_printed(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["--version"])
    assert (ended.value.code, capsys.readouterr().out) == (0, f"swarmwire-agent {version('swarmwire-agent')}\n")


def test_help_example_passes_the_check(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").write_text(cli.EXAMPLE.partition("robot.toml:\n")[2].partition("exit codes")[0])
    (tmp_path / "flocking.py").write_text(
        "from swarmwire.agent import Agent\nclass Flock(Agent):\n    def step(self, robot): pass\n"
    )
    assert cli.main(["check", "--config", "robot.toml"]) == 0
    assert capsys.readouterr().out.startswith("flock-3: flocking.py:Flock on epuck2 by epuck2 at 192.168.1.23")


def test_check_prints_the_configuration_without_connecting(installed, tmp_path, capsys):
    assert cli.main(["check", "--config", str(_settings(tmp_path, installed)), "--rate-hz", "20"]) == 0
    assert capsys.readouterr().out == (
        f"flock-0: robot_players.py:Driving on epuck2 by written at {installed}, radio none, 20 Hz, "
        "at most 0.0691 m/s and 2.61 rad/s\n"
    )
    assert deeds(installed) == []


@pytest.mark.parametrize("flags", REFUSED)
def test_wrong_flags_are_one_line_and_exit_code_2(installed, capsys, flags):
    try:
        code = cli.main(["check", DRIVING, *robot_flags(installed), *flags.split(" ")])
    except SystemExit as ended:
        code = ended.code
    output = capsys.readouterr().err
    assert (code, output.count("\n")) == (2, 1)
    assert REFUSED[flags] in output
    assert deeds(installed) == []


@pytest.mark.parametrize(
    ("agent", "message"),
    [
        ("nothing.py:Mine", "AGENT: there is no file"),
        (f"{PLAYERS}:Drivng", "did you mean Driving?"),
        (f"{PLAYERS}:Knowing", "AGENT: Knowing needs 'positioning', which the body epuck2 lacks"),
    ],
)
def test_agent_that_is_unusable_is_refused(installed, capsys, agent, message):
    assert cli.main(["check", agent, *robot_flags(installed)]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "remedy"),
    [
        ((), "expected --radio zenoh with --tracker, or --radio world; "),
        (("--radio", "zenoh", "--listen", "tcp/127.0.0.1:0"), "expected --tracker"),
    ],
)
def test_unmet_needs_name_the_flags_that_meet_them(installed, capsys, flags, remedy):
    assert cli.main(["check", f"{PLAYERS}:Ranging", *robot_flags(installed, *flags)]) == 2
    assert remedy in capsys.readouterr().err


def test_settings_file_errors_name_the_file_even_with_flags(installed, tmp_path, capsys):
    settings = _settings(tmp_path, installed, "rate_hz = 0\n")
    assert cli.main(["check", "--config", str(settings), "--log", "log"]) == 2
    assert capsys.readouterr().err == f"{settings}: rate_hz: expected at least 1 Hz, got 0\n"


def test_drivers_are_listed_with_options_or_the_reason_they_cannot_load(installed, capsys):
    assert cli.main(["drivers"]) == 0
    lines = capsys.readouterr().out.splitlines()
    at = lines.index("written: Writes a line into the file at its address for all that it does. Body: epuck2")
    assert lines[at + 1] == "  gone (False): whether nobody answers"
    lacking = next(line for line in lines if line.startswith("lacking"))
    assert "No module named 'a_library_that_nobody_has': install written-driver[lacking]" in lacking


def test_drivers_of_the_same_name_are_refused(installed, tmp_path, monkeypatch, capsys):
    other = tmp_path / "other" / "another-1.0.dist-info"
    other.mkdir(parents=True)
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: another\nVersion: 1.0\n")
    (other / "entry_points.txt").write_text("[swarmwire.drivers]\nwritten = elsewhere:Written\n")
    monkeypatch.syspath_prepend(other.parent)
    assert cli.main(["check", DRIVING, *robot_flags(installed)]) == 2
    assert re.search("expected one driver of the name 'written'.*another", capsys.readouterr().err)


def test_stop_motors_reads_the_settings_of_the_run(installed, tmp_path, capsys):
    assert cli.main(["stop-motors", "--config", str(_settings(tmp_path, installed))]) == 0
    assert [deed for _, deed in deeds(installed)] == ["open", "stop", "close"]
    assert capsys.readouterr().out == "flock-0: stopped\n"


def test_stop_motors_of_an_absent_robot_fails_in_one_line(installed, capsys):
    assert cli.main(["stop-motors", *robot_flags(installed, "--option", "gone=true")]) == 1
    assert capsys.readouterr().err == "nobody answers\n"
