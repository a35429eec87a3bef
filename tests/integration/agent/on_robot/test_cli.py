import json
import re
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from swarmwire.agent import cli
from swarmwire.agent.on_robot import run
from swarmwire.agent.on_robot.network_parts import NetworkParts
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.swarm_control import ESTOP, STATUS, ask_all
from swarmwire.comms.wire.swarm_keys import SwarmKeys
from swarmwire.comms.wire.swarm_session import endpoints_of, open_swarm
from swarmwire.metrics.real_log.real_logs import read_real_logs
from tests.support.agent.on_robot.installed import Command, deeds, install
from tests.support.agent.on_robot.scripted import PLAYERS
from tests.support.waiting import until

DRIVING = f"{PLAYERS}:Driving"

PATIENT = ("--watchdog-s", "5")  # the machine that tests run on may be busy


@pytest.fixture
def installed(tmp_path, monkeypatch) -> Iterator[Path]:
    """Where the robot writes what it is asked; its driver is found in this process, too."""
    folder = tmp_path / "installed"
    install(folder)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    yield tmp_path / "deeds"
    sys.modules.pop("written_driver", None)


def _robot(file: Path, *more: str) -> list[str]:
    return ["--driver", "written", "--address", str(file), *more]


def _settings(folder: Path, file: Path, more: str = "") -> Path:
    settings = folder / "robot.toml"
    settings.write_text(
        f'format = 1\nname = "flock-0"\nagent = "{DRIVING}"\ndriver = {{ name = "written", address = "{file}" }}\n{more}'
    )
    return settings


def test_help_teaches_with_an_example(capsys):
    for arguments in (["--help"], ["run", "--help"], ["stop-motors", "--help"], ["drivers", "--help"]):
        with pytest.raises(SystemExit) as ended:
            cli.main(arguments)
        assert ended.value.code == 0
    told = capsys.readouterr().out
    assert "swarmwire-agent run avoid.py:Avoid --driver epuck2" in told
    assert "exit codes: 0 it ended, 1 it failed, 2 bad input, 130 Ctrl-C" in told
    assert "--duration-s S" in told


def test_the_help_of_stop_motors_lists_what_it_needs_alone(capsys):
    with pytest.raises(SystemExit):
        cli.main(["stop-motors", "--help"])
    told = capsys.readouterr().out
    flags = {"--help", "--config", "--driver", "--address", "--option", "--name", "--body"}
    assert set(re.findall("--[a-z-]+", told)) == flags
    assert "AGENT" not in told


def test_the_version_is_told(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["--version"])
    assert (ended.value.code, capsys.readouterr().out) == (0, f"swarmwire-agent {version('swarmwire-agent')}\n")


def test_the_example_of_the_help_is_one(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").write_text(cli.EXAMPLE.partition("robot.toml:\n")[2].partition("exit codes")[0])
    (tmp_path / "flocking.py").write_text(
        "from swarmwire.agent import Agent\nclass Flock(Agent):\n    def step(self, robot): pass\n"
    )
    assert cli.main(["check", "--config", "robot.toml"]) == 0
    assert capsys.readouterr().out.startswith("flock-3: flocking.py:Flock on epuck2 by epuck2 at 192.168.1.23")


def test_check_says_what_would_run_and_connects_nothing(installed, tmp_path, capsys):
    assert cli.main(["check", "--config", str(_settings(tmp_path, installed)), "--rate-hz", "20"]) == 0
    assert capsys.readouterr().out == (
        f"flock-0: robot_players.py:Driving on epuck2 by written at {installed}, radio none, 20 Hz, "
        "at most 0.0691 m/s and 2.61 rad/s\n"
    )
    assert deeds(installed) == []


REFUSED = {
    "--rate-hz 0": "--rate-hz: expected at least 1 Hz, got 0",
    "--watchdog-s 0.1": "--watchdog-s: expected more than a period of --rate-hz, 0.1 s",
    "--max-linear-mps 9": "--max-linear-mps: expected at most 0.1382 m/s, which the epuck2 can do; got 9.0",
    "--param linear=1": "--param linear: unknown parameter of Driving",
    "--param linear_mps=fast": "--param linear_mps: expected a number, got 'fast'",
    "--param linear_mps": "--param: expected a name and its value",
    "--option gonne=true": "--option gonne: unknown key; expected one of gone (did you mean gone?)",
    "--body epukc": "--body: expected one of",
    "--body mine.toml": "--body: expected a readable file",
    "--address nowhere": "--address: expected the path of a file; got 'nowhere'",
    "--driver writen": "--driver: expected a driver: one of",
    "--driver lacking": "pip install 'written-driver[lacking]'",
    "--radio smoke": "--radio: expected one of zenoh, air, none; got 'smoke'",
    "--radio zenoh": "command line: --listen: expected --listen, --connect or --multicast: radio and tracker",
    "--radio zenoh --connect nowhere": 'expected endpoints such as "tls/10.0.0.5:7447", got "nowhere"',
    "--radio zenoh --listen tcp/0.0.0.0:0": "expected --ca, --certificate and --key, or --insecure",
    "--duration-s 0": "--duration-s: expected more than 0 s, got 0",
    "--duration-s soon": "--duration-s: invalid",
}


@pytest.mark.parametrize("flags", REFUSED)
def test_what_is_wrong_with_the_flags_is_one_line_and_exit_code_2(installed, capsys, flags):
    try:
        code = cli.main(["check", DRIVING, *_robot(installed), *flags.split(" ")])
    except SystemExit as ended:
        code = ended.code
    told = capsys.readouterr().err
    assert (code, told.count("\n")) == (2, 1)
    assert REFUSED[flags] in told
    assert deeds(installed) == []


@pytest.mark.parametrize(
    ("agent", "told"),
    [
        ("nothing.py:Mine", "AGENT: there is no file"),
        (f"{PLAYERS}:Drivng", "did you mean Driving?"),
        (f"{PLAYERS}:Knowing", "AGENT: Knowing needs 'positioning', which the body epuck2 lacks"),
    ],
)
def test_an_agent_that_is_none_or_lacks_something_is_refused(installed, capsys, agent, told):
    assert cli.main(["check", agent, *_robot(installed)]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "cure"),
    [((), "expected --radio zenoh or --radio air"), (("--radio", "zenoh"), "expected --tracker")],
)
def test_what_an_agent_needs_is_told_in_the_flags_that_would_give_it(installed, capsys, flags, cure):
    listen = ("--listen", "tcp/127.0.0.1:0") if flags else ()
    assert cli.main(["check", f"{PLAYERS}:Ranging", *_robot(installed, *flags, *listen)]) == 2
    assert cure in capsys.readouterr().err


def test_faults_of_the_file_name_the_file_even_where_flags_are_given(installed, tmp_path, capsys):
    settings = _settings(tmp_path, installed, "rate_hz = 0\n")
    assert cli.main(["check", "--config", str(settings), "--log", "log"]) == 2
    assert capsys.readouterr().err == f"{settings}: rate_hz: expected at least 1 Hz, got 0\n"


def test_drivers_are_listed_with_their_options_and_those_that_lack_something(installed, capsys):
    assert cli.main(["drivers"]) == 0
    lines = capsys.readouterr().out.splitlines()
    at = lines.index("written: Writes a line into the file at its address for all that it does. Body: epuck2")
    assert lines[at + 1] == "  gone (False): whether nobody answers"
    lacking = next(line for line in lines if line.startswith("lacking"))
    assert "No module named 'a_library_that_nobody_has': pip install 'written-driver[lacking]'" in lacking


def test_two_drivers_of_one_name_are_refused(installed, tmp_path, monkeypatch, capsys):
    other = tmp_path / "other" / "another-1.0.dist-info"
    other.mkdir(parents=True)
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: another\nVersion: 1.0\n")
    (other / "entry_points.txt").write_text("[swarmwire.drivers]\nwritten = elsewhere:Written\n")
    monkeypatch.syspath_prepend(other.parent)
    assert cli.main(["check", DRIVING, *_robot(installed)]) == 2
    told = capsys.readouterr().err
    assert "expected one driver of the name 'written'" in told
    assert "another" in told


def test_motors_are_stopped_by_the_settings_of_the_run(installed, tmp_path, capsys):
    assert cli.main(["stop-motors", "--config", str(_settings(tmp_path, installed))]) == 0
    assert [deed for _, deed in deeds(installed)] == ["open", "stop", "close"]
    assert capsys.readouterr().out == "flock-0: stopped\n"


def test_a_robot_that_is_not_there_cannot_be_stopped_which_is_one_line(installed, capsys):
    assert cli.main(["stop-motors", *_robot(installed, "--option", "gone=true")]) == 1
    assert capsys.readouterr().err == "nobody answers\n"


def test_a_run_ends_after_its_duration_with_a_summary_and_a_whole_log(tmp_path):
    environment, file = install(tmp_path / "installed"), tmp_path / "deeds"
    log = ("--log", str(tmp_path / "log"))
    with Command(environment, "run", DRIVING, *_robot(file, "--duration-s", "0.5", *PATIENT, *log)) as command:
        code, out, err = command.wait()
    assert (code, err) == (0, "")
    begun, ended = out.splitlines()
    assert begun.startswith("robot-0: robot_players.py:Driving on epuck2 by written at")
    assert ended.startswith("robot-0: ended (duration) after ")
    done = [deed for _, deed in deeds(file)]
    assert done[0] == "open"
    assert done[-2:] == ["stop", "close"]
    assert set(done[1:-2]) == {"act 0.03"}
    folder = next((tmp_path / "log").glob("robot-0-*Z"))
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["ended"] == "duration"
    assert summary["ticks"] == len(done) - 3 == len((folder / "ticks.csv").read_text().splitlines()) - 1
    read = read_real_logs(folder)
    assert (read.names, read.notes, len(read.robots[0].steps.time_s)) == (("robot-0",), (), summary["ticks"])
    facts = json.loads((folder / "robot.json").read_text())
    assert (facts["format"], facts["name"], facts["index"], facts["robots"]) == (1, "robot-0", 0, ["robot-0"])
    assert len(facts["agent_sha256"]) == 64
    assert facts["body"]["name"] == "epuck2"
    status = json.loads((tmp_path / "log" / "robot-0-status.json").read_text())
    assert (status["state"], status["ended"], status["charge"]) == ("ended", "duration", 0.5)


@pytest.mark.parametrize(
    ("more", "code", "told"),
    [
        (("Driving", "--option", "gone=true"), 1, "no driver: nobody answers"),
        (("Failing",), 1, "agent failed: RuntimeError: the third step"),
    ],
)
def test_a_run_that_fails_says_why_and_ends_with_1(tmp_path, more, code, told):
    environment, file = install(tmp_path / "installed"), tmp_path / "deeds"
    agent, *flags = more
    with Command(environment, "run", f"{PLAYERS}:{agent}", *_robot(file, "--no-guard", *flags)) as command:
        got, out, err = command.wait()
    assert got == code
    assert f"robot-0: ended ({told}) after " in out
    assert "no faults" not in out
    assert told.partition(": ")[2] in err
    assert [deed for _, deed in deeds(file)][-1:] in ([], ["close"])


def test_a_run_that_ends_while_its_robot_is_lost_says_that_it_may_go_on(tmp_path):
    environment, file = install(tmp_path / "installed"), tmp_path / "deeds"
    with Command(environment, "run", DRIVING, *_robot(file, "--no-guard")) as command:
        until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
        file.with_name("deeds.gone").touch()
        until(lambda: any(deed == "lost" for _, deed in deeds(file)))
        command.process.send_signal(signal.SIGTERM)
        code, _, err = command.wait()
    assert code == 1
    lost, out_of_reach = err.splitlines()
    assert "the robot is lost, and tried again" in lost
    assert out_of_reach.endswith("the robot is out of reach, and may go on as it was told last")


def test_the_guard_hears_of_an_agent_until_all_is_closed(installed, monkeypatch):
    heard: list[bool] = []

    def slow_to_close(*parts: Any) -> NetworkParts:
        parts[-1].callback(lambda: heard.append(any(thread.name == "watchdog" for thread in threading.enumerate())))
        return NetworkParts()

    monkeypatch.setattr(run, "network_parts", slow_to_close)
    assert cli.main(["run", DRIVING, *_robot(installed, "--no-guard", "--duration-s", "0.2")]) == 0
    assert heard == [True]


def test_an_operator_asks_how_the_robot_is_and_stops_it_for_good(tmp_path):
    environment, file = install(tmp_path / "installed"), tmp_path / "deeds"
    network = Network(listen=("tcp/127.0.0.1:0",))
    session = open_swarm(network)
    try:
        endpoint = endpoints_of(session, network)[0]
        radio = (*PATIENT, "--radio", "zenoh", "--connect", endpoint, "--swarm", "lab")
        with Command(environment, "run", DRIVING, *_robot(file, *radio)) as command:
            keys = SwarmKeys("lab")
            told = ask_all(session, keys, STATUS, ["robot-0"], 30.0)["robot-0"]
            assert told is not None
            assert json.loads(told)["state"] == "running"
            until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
            assert ask_all(session, keys, ESTOP, ["robot-0"], 30.0) == {"robot-0": "stopped"}
            done = len(deeds(file))
            until(lambda: len(deeds(file)) > done + 3)
            assert {deed for _, deed in deeds(file)[done + 1 :]} == {"stop"}
            command.process.send_signal(signal.SIGINT)
            assert command.wait()[0] == 130
    finally:
        session.close()


def test_a_robot_that_an_agent_drives_is_stopped_for_good_by_that_agent(tmp_path):
    environment, file = install(tmp_path / "installed"), tmp_path / "deeds"
    with Command(environment, "run", DRIVING, *_robot(file, *PATIENT)) as agent:
        until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
        driving = deeds(file)[0][0]
        with Command(environment, "stop-motors", *_robot(file)) as stopping:
            code, out, err = stopping.wait()
        assert (code, err) == (0, "")
        assert out == f"robot-0: stopped, for good, by process {driving}, which drives it\n"
        done = len(deeds(file))
        until(lambda: len(deeds(file)) > done + 3)
        assert set(deeds(file)[done + 1 :]) == {(driving, "stop")}
        agent.process.send_signal(signal.SIGINT)
        assert agent.wait()[0] == 130
    with Command(environment, "stop-motors", *_robot(file)) as stopping:
        assert stopping.wait()[:2] == (0, "robot-0: stopped\n")


def test_an_agent_that_does_not_say_that_it_stopped_the_robot_is_told_of(tmp_path):
    environment, file = install(tmp_path / "installed"), tmp_path / "deeds"
    with Command(environment, "run", DRIVING, *_robot(file, "--no-guard")) as agent:
        until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
        agent.process.send_signal(signal.SIGSTOP)
        with Command(environment, "stop-motors", *_robot(file)) as stopping:
            code, _, err = stopping.wait()
        held = f"process {agent.process.pid} drives the robot at {file}, and did not say within 2 s that it stopped it"
        assert (code, err) == (1, f"{held}\n")


def test_a_robot_that_an_agent_drives_is_not_driven_by_another(tmp_path):
    environment, file = install(tmp_path / "installed"), tmp_path / "deeds"
    with Command(environment, "run", DRIVING, *_robot(file, *PATIENT)):
        until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
        driving = deeds(file)[0][0]
        with Command(environment, "run", DRIVING, *_robot(file)) as second:
            code, out, err = second.wait()
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert f"the robot at {file} is driven by process {driving} here" in err
        assert {process for process, _ in deeds(file)} == {driving}


def test_systemd_is_told_that_the_robot_runs_lives_and_stops(tmp_path):
    environment, file = install(tmp_path / "installed"), tmp_path / "deeds"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(30.0)
        environment["NOTIFY_SOCKET"] = str(tmp_path / "notify")
        with Command(environment, "run", DRIVING, *_robot(file, "--duration-s", "1.3", *PATIENT)) as command:
            assert [systemd.recv(64) for _ in range(3)] == [b"READY=1", b"WATCHDOG=1", b"STOPPING=1"]
            assert command.wait()[0] == 0
