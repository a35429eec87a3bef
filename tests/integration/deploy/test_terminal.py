"""Commands at a terminal: the panel, Ctrl-C, and the commands of a world."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from swarmwire.deploy import RunFolder, repeat, run
from tests.support.deploy.pseudo_terminal import terminal
from tests.support.deploy.runs import LOSSY, called, refused_command, swarmwire

LONG = ["--set", "duration_s=3600"]
SHORT = ("--set", "duration_s=2")


def tick(picture: str) -> int:
    match = re.search(r"tick +(\d+)/36000", picture)
    return int(match[1]) if match else -1


def test_panel_shows_a_pause_and_a_speed_of_ctl_and_ends_with_the_run(tmp_path):
    with terminal("run", LOSSY, *LONG, "--out", tmp_path / "run") as user:
        user.wait(lambda picture: "running" in picture and tick(picture) > 0)
        assert ctl(tmp_path / "run", "pause").returncode == 0
        paused_tick = tick(user.wait(lambda picture: "paused" in picture))
        for _ in range(3):
            assert tick(user.wait(lambda _: True)) == paused_tick
        ctl(tmp_path / "run", "speed", "2")
        ctl(tmp_path / "run", "resume")
        user.wait(lambda picture: "at most" in picture and tick(picture) > paused_tick)
        ctl(tmp_path / "run", "stop")
        text = user.transcript()
        assert user.process.returncode == 130
        assert not user.changed()
        assert user.output.rfind(b"\x1b[?25h") > user.output.rfind(b"\x1b[?25l")  # the cursor is there again
    after = text[text.rindex("─╯") :]
    assert "interrupted" in after
    assert "swarmwire view" in after
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["ended"] == "interrupted"
    assert summary["ticks"] > paused_tick


def ctl(run_folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return swarmwire("ctl", "--run", run_folder, *arguments)


def test_ctrl_c_ends_a_run_in_real_time_over_runners_and_gives_the_terminal_back(tmp_path):
    arguments = ["--runners", "2", "--realtime", "10", "--out", tmp_path / "run"]
    with terminal("run", LOSSY, *LONG, *arguments, columns=120, rows=40) as user:
        user.wait(lambda picture: "2 ready · 0 lost" in picture and tick(picture) > 0)
        ctl(tmp_path / "run", "speed", "20")
        user.wait(lambda picture: "real time x 20" in picture)
        user.type("\x03")
        user.transcript()
        assert user.process.returncode == 130
        assert not user.changed()
    realtime = json.loads((tmp_path / "run" / "summary.json").read_text())["realtime"]
    assert realtime["factor"] == 20.0


def test_without_a_terminal_there_are_plain_lines(tmp_path):
    ended = swarmwire("run", LOSSY, "--set", "duration_s=2", "--out", tmp_path / "run")
    assert "\x1b" not in ended.stdout
    lines = [line for line in ended.stdout.splitlines() if line.startswith("tick ")]
    assert [line.split(",")[0] for line in lines] == ["tick 5/20", "tick 10/20", "tick 15/20", "tick 20/20"]
    for line in lines:
        assert re.search(r", order [\d.]+, largest_component [\d.]+, components \d+, link PDR so far [\d.]+$", line)


def test_quiet_option_shows_no_panel(tmp_path):
    with terminal("run", LOSSY, "--set", "duration_s=1", "--quiet", "--out", tmp_path / "run") as user:
        assert user.transcript() == ""
        assert user.process.returncode == 0


def test_closing_the_terminal_ends_a_run_with_its_summary(tmp_path):
    with terminal("run", LOSSY, *LONG, "--runners", "2", "--out", tmp_path / "run") as user:
        user.wait(lambda picture: tick(picture) > 0)
        user.close()
        assert user.process.wait(20.0) == 129
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["ended"] == "interrupted"


@contextmanager
def world(folder: Path, *arguments: str | Path) -> Generator["subprocess.Popen[str]"]:
    """A world in a process of its own that is ended with the test."""
    command = [sys.executable, "-m", "swarmwire.deploy", "world", LOSSY, *SHORT, "--out", folder, *arguments]
    process = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


def listens_at(process: "subprocess.Popen[str]") -> tuple[str, str]:
    """Where a world listens, and what it says is to be typed elsewhere."""
    line = process.stdout.readline()
    while "listens at" not in line:
        assert line, process.stderr and process.stderr.read()
        line = process.stdout.readline()
    match = re.search(r"listens at (\S+)[,;]", line)
    assert match
    return match[1], process.stdout.readline().strip()


def test_join_from_two_terminals_makes_the_same_run_as_one(tmp_path):
    folder = tmp_path / "run"
    with world(folder, "--listen", "tcp/127.0.0.1:0", "--observe", "tcp/127.0.0.1:0") as process:
        endpoint, typed = listens_at(process)
        assert typed == f"swarmwire join {endpoint} --robots 20"
        join = [sys.executable, "-m", "swarmwire.agent.cli", "join", endpoint, "--robots", "5"]
        first = subprocess.Popen(join, stderr=subprocess.PIPE, text=True)
        try:
            assert process.stdout.readline().startswith("0 of 20 robots have agents; without: flock-0")
            assert process.stdout.readline().startswith("5 of 20 robots have agents; without: flock-5")
            second = swarmwire("join", endpoint, "--scenario", LOSSY, "--processes", "3")
            assert (second.returncode, second.stderr.splitlines()[-1]) == (0, "the run is over")
            out, errors = process.communicate(timeout=60.0)
            assert first.wait(20.0) == 0
        finally:
            first.kill()
            first.communicate()
    assert process.returncode == 0
    assert out.startswith("20 of 20 robots have agents\n")
    assert len(re.findall(r" joined with .* before the first tick", errors)) == 2
    summary = RunFolder(folder).summary
    assert summary["trajectory_sha256"] == run(LOSSY, overrides=["duration_s=2"]).trajectory_sha256
    assert [change["what"] for change in summary["runner_events"]] == ["joined", "joined"]
    assert repeat(folder).same


def test_observe_address_in_use_is_refused_before_anybody_joins(tmp_path):
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        at = f"tcp/127.0.0.1:{listener.getsockname()[1]}"
        listening = ("--listen", "tcp/127.0.0.1:0", "--observe", at)
        with world(tmp_path / "run", *listening) as process:
            _, errors = process.communicate()
    assert process.returncode == 2
    assert f"--observe: {at}: " in errors
    assert "Traceback" not in errors
    assert not (tmp_path / "run").exists()


def test_certificates_are_asked_for_beyond_this_machine(tmp_path, monkeypatch, capsys):
    world = ("world", LOSSY, "--listen", "tcp/0.0.0.0:0", "--out", tmp_path / "x")
    for command, where in ((world, "--listen"), (("join", "tcp/10.0.0.5:7447"), "ENDPOINT")):
        refused_command(monkeypatch, capsys, *command, match=f"{where}: .*expected --certs, or --insecure")
    assert not (tmp_path / "x").exists()


@pytest.fixture
def certs(tmp_path, monkeypatch, capsys) -> Path:
    folder = tmp_path / "certs"
    assert called(monkeypatch, capsys, "certs", "init", folder)[0] == 0
    for name, purpose in (("world", "world"), ("r1", "runner"), ("r2", "runner"), ("eye", "observer")):
        issue = ("certs", "issue", folder, name, "--for", purpose, "--host", "127.0.0.1")
        code, _, errors = called(monkeypatch, capsys, *issue)
        assert code == 0, errors
    return folder


def impostor(folder: Path, certs: Path) -> Path:
    """A folder in which r1's certificate has the name of r2's."""
    other = folder / "impostor"
    other.mkdir()
    for file, name in (("ca.pem", "ca.pem"), ("r1.pem", "r2.pem"), ("r1.key", "r2.key")):
        shutil.copy(certs / file, other / name)
    return other


def test_with_certificates_a_runner_is_who_its_own_says(tmp_path, certs):
    with world(tmp_path / "run", "--listen", "tls/127.0.0.1:0", "--certs", certs, "--name", "world") as process:
        endpoint, typed = listens_at(process)
        assert typed == f"swarmwire join {endpoint} --robots 20 --certs DIR"
        stranger = swarmwire("join", endpoint, "--certs", certs, "--name", "eye")
        assert stranger.returncode == 1
        assert "let eye in" in stranger.stderr
        liar = swarmwire("join", endpoint, "--certs", impostor(tmp_path, certs), "--name", "r2")
        assert liar.returncode == 1
        assert "access rules" in liar.stderr
        played = swarmwire("join", endpoint, "--certs", certs, "--name", "r1")
        assert (played.returncode, played.stderr.splitlines()[-1]) == (0, "the run is over")
        _, errors = process.communicate(timeout=60.0)
    assert "r1 joined with flock-0 … flock-19 (20 robots) before the first tick" in errors


def test_world_at_a_terminal_shows_who_is_missing_until_ctrl_c(tmp_path):
    arguments = ("world", LOSSY, "--listen", "tcp/127.0.0.1:0", "--out", tmp_path / "run")
    with terminal(*arguments) as window:
        while "0 of 20 robots have agents" not in window.text:
            assert window._read(), window.text
        os.kill(window.process.pid, signal.SIGINT)
        text = window.transcript()
    assert window.process.returncode == 130
    assert "interrupted" in text
