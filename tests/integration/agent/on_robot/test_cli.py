"""`swarmwire-agent run` and `stop-motors` as programs: ends, logs, operators, one agent a robot."""

import json
import signal
import socket
import threading
from pathlib import Path
from typing import Any

import pytest

from swarmwire.agent import cli
from swarmwire.agent.on_robot import assembly
from swarmwire.agent.on_robot.assembly import NetworkParts
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import ESTOP, STATUS, ask_all, endpoints_of, open_swarm
from swarmwire.comms.wire.sessions import closed_after
from swarmwire.metrics.real.real_log.real_logs import read_real_logs
from tests.support.agent.on_robot.installed import DRIVING, Command, deeds, install, robot_flags
from tests.support.agent.on_robot.scripted import PLAYERS
from tests.support.clocks import until

PATIENT = ("--watchdog-s", "5")  # the machine that tests run on may be busy


@pytest.fixture
def environment(tmp_path) -> dict[str, str]:
    return install(tmp_path / "installed")


@pytest.fixture
def file(tmp_path) -> Path:
    """The file of the robot's deeds."""
    return tmp_path / "deeds"


def test_agent_run_ends_after_its_duration_with_summary_and_log(tmp_path, environment, file):
    log = ("--log", str(tmp_path / "log"))
    with Command(environment, "run", DRIVING, *robot_flags(file, "--duration-s", "0.5", *PATIENT, *log)) as command:
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
    ("more", "reason", "last"),
    [
        (("Driving", "--option", "gone=true"), "no driver: nobody answers", ["close"]),
        (("Failing",), "agent failed: RuntimeError: the third step", ["stop", "close"]),
    ],
)
def test_failed_agent_run_names_the_reason_and_needs_no_guard(environment, file, more, reason, last):
    agent, *flags = more
    with Command(environment, "run", f"{PLAYERS}:{agent}", *robot_flags(file, *PATIENT, *flags)) as command:
        code, out, err = command.wait()
    assert code == 1
    assert f"robot-0: ended ({reason}) after " in out
    assert "no faults" not in out
    assert reason.partition(": ")[2] in err
    assert "guard" not in err
    assert [deed for _, deed in deeds(file)][-2:] == last
    assert len({process for process, _ in deeds(file)}) <= 1


def test_agent_run_that_ends_with_a_lost_robot_warns(environment, file):
    with Command(environment, "run", DRIVING, *robot_flags(file, "--no-guard")) as command:
        until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
        file.with_name("deeds.gone").touch()
        until(lambda: any(deed == "lost" for _, deed in deeds(file)))
        command.process.send_signal(signal.SIGTERM)
        code, _, err = command.wait()
    assert code == 1
    lost, out_of_reach = err.splitlines()
    assert "the robot is lost, and tried again" in lost
    assert out_of_reach.endswith("the robot is out of reach and may keep executing its last command")


def test_heartbeats_continue_until_the_agent_is_closed(tmp_path, monkeypatch):
    install(tmp_path / "installed")
    monkeypatch.syspath_prepend(tmp_path / "installed")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    received: list[bool] = []

    def slow_to_close(*parts: Any) -> NetworkParts:
        parts[-1].callback(lambda: received.append(any(thread.name == "watchdog" for thread in threading.enumerate())))
        return NetworkParts()

    monkeypatch.setattr(assembly, "network_parts", slow_to_close)
    assert cli.main(["run", DRIVING, *robot_flags(tmp_path / "deeds", "--no-guard", "--duration-s", "0.2")]) == 0
    assert received == [True]


def test_operator_reads_the_status_and_stops_the_robot(environment, file):
    network = Network(listen=("tcp/127.0.0.1:0",))
    with closed_after(open_swarm(network)) as session:
        endpoint = endpoints_of(session, network)[0]
        radio = (*PATIENT, "--radio", "zenoh", "--connect", endpoint, "--swarm", "lab")
        with Command(environment, "run", DRIVING, *robot_flags(file, *radio)) as command:
            keys = SwarmKeys("lab")
            reply = ask_all(session, keys, STATUS, ["robot-0"], 30.0)["robot-0"]
            assert reply is not None
            assert json.loads(reply)["state"] in {"starting", "running"}
            until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
            reply = ask_all(session, keys, STATUS, ["robot-0"], 30.0)["robot-0"]
            assert reply is not None
            assert json.loads(reply)["state"] == "running"
            assert ask_all(session, keys, ESTOP, ["robot-0"], 30.0) == {"robot-0": "stopped"}
            done = len(deeds(file))
            until(lambda: len(deeds(file)) > done + 3)
            assert {deed for _, deed in deeds(file)[done + 1 :]} == {"stop"}
            command.process.send_signal(signal.SIGINT)
            assert command.wait()[0] == 130


def test_stop_motors_makes_the_driving_agent_stop_the_robot(environment, file):
    with Command(environment, "run", DRIVING, *robot_flags(file, *PATIENT)) as agent:
        until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
        driving = deeds(file)[0][0]
        with Command(environment, "stop-motors", *robot_flags(file)) as stopping:
            code, out, err = stopping.wait()
        assert (code, err) == (0, "")
        assert out == f"robot-0: stopped by process {driving}, which drives it; start its agent again to continue\n"
        done = len(deeds(file))
        until(lambda: len(deeds(file)) > done + 3)
        assert set(deeds(file)[done + 1 :]) == {(driving, "stop")}
        agent.process.send_signal(signal.SIGINT)
        assert agent.wait()[0] == 130
    with Command(environment, "stop-motors", *robot_flags(file)) as stopping:
        assert stopping.wait()[:2] == (0, "robot-0: stopped\n")


def test_stop_motors_reports_an_agent_that_does_not_confirm(environment, file):
    with Command(environment, "run", DRIVING, *robot_flags(file, "--no-guard")) as agent:
        until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
        agent.process.send_signal(signal.SIGSTOP)
        with Command(environment, "stop-motors", *robot_flags(file)) as stopping:
            code, _, err = stopping.wait()
        held = f"process {agent.process.pid} drives the robot at {file}, and did not confirm the stop within 2 s"
        assert (code, err) == (1, f"{held}\n")


def test_robot_is_driven_by_a_single_agent(environment, file):
    with Command(environment, "run", DRIVING, *robot_flags(file, *PATIENT)):
        until(lambda: any(deed == "act 0.03" for _, deed in deeds(file)))
        driving = deeds(file)[0][0]
        with Command(environment, "run", DRIVING, *robot_flags(file)) as second:
            code, out, err = second.wait()
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert f"the robot at {file} is driven by process {driving} here" in err
        assert {process for process, _ in deeds(file)} == {driving}


def test_systemd_is_notified_of_start_heartbeat_and_stop(tmp_path, environment, file):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(30.0)
        environment["NOTIFY_SOCKET"] = str(tmp_path / "notify")
        with Command(environment, "run", DRIVING, *robot_flags(file, "--duration-s", "1.3", *PATIENT)) as command:
            assert [systemd.recv(64) for _ in range(3)] == [b"READY=1", b"WATCHDOG=1", b"STOPPING=1"]
            assert command.wait()[0] == 0
