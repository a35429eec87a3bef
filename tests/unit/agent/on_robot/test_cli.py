"""`swarmwire-agent` in this process: help, checks that connect nothing, and what is refused in one line."""

import re
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest

from swarmwire.agent import cli
from tests.support.agent.on_robot.installed import DRIVING, deeds, install, robot_flags
from tests.support.agent.on_robot.scripted import PLAYERS


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
    "--radio smoke": "--radio: expected one of zenoh, world, none; got 'smoke'",
    "--radio zenoh": "command line: --listen: expected --listen, --connect or --multicast: radio and tracker",
    "--radio zenoh --connect nowhere": 'expected endpoints such as "tls/10.0.0.5:7447", got "nowhere"',
    "--radio zenoh --listen tcp/0.0.0.0:0": "expected --ca, --certificate and --key, or --insecure",
    "--duration-s 0": "--duration-s: expected more than 0 s, got 0",
    "--duration-s soon": "--duration-s: invalid",
}


@pytest.mark.parametrize("flags", REFUSED)
def test_what_is_wrong_with_the_flags_is_one_line_and_exit_code_2(installed, capsys, flags):
    try:
        code = cli.main(["check", DRIVING, *robot_flags(installed), *flags.split(" ")])
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
    assert cli.main(["check", agent, *robot_flags(installed)]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "cure"),
    [((), "expected --radio zenoh or --radio world"), (("--radio", "zenoh"), "expected --tracker")],
)
def test_what_an_agent_needs_is_told_in_the_flags_that_would_give_it(installed, capsys, flags, cure):
    listen = ("--listen", "tcp/127.0.0.1:0") if flags else ()
    assert cli.main(["check", f"{PLAYERS}:Ranging", *robot_flags(installed, *flags, *listen)]) == 2
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
    assert cli.main(["check", DRIVING, *robot_flags(installed)]) == 2
    told = capsys.readouterr().err
    assert "expected one driver of the name 'written'" in told
    assert "another" in told


def test_motors_are_stopped_by_the_settings_of_the_run(installed, tmp_path, capsys):
    assert cli.main(["stop-motors", "--config", str(_settings(tmp_path, installed))]) == 0
    assert [deed for _, deed in deeds(installed)] == ["open", "stop", "close"]
    assert capsys.readouterr().out == "flock-0: stopped\n"


def test_a_robot_that_is_not_there_cannot_be_stopped_which_is_one_line(installed, capsys):
    assert cli.main(["stop-motors", *robot_flags(installed, "--option", "gone=true")]) == 1
    assert capsys.readouterr().err == "nobody answers\n"
