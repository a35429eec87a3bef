"""Network interfaces of robots: programs reach one another over the radio, and nothing is left of a run."""

import os
import re
import signal
import socket
import subprocess
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path

import psutil
import pytest

from swarmwire.deploy import Simulation, repeat, run
from swarmwire.world.interfaces import namespaces
from swarmwire.world.interfaces.entering import INTERFACES
from tests.support.clocks import until
from tests.support.deploy.interfaces import DISK, STILL, line, needs_interfaces, needs_program, running
from tests.support.refusals import refused_input

pytestmark = needs_interfaces
LATENCY_S = 0.02
CHATTER = """
from swarmwire.agent import Agent, Message, Robot, u4

class Count(Message):
    received: u4

class Chatter(Agent):
    def __init__(self) -> None:
        self.received = 0

    def step(self, robot: Robot) -> None:
        self.received += len(robot.radio.received(Count))
        robot.note(value=self.received)
        robot.radio.send(Count(received=self.received))
"""

# Types of the frames that a device receives until a second passes without one.
SNIFFER = """
import socket

device = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
device.bind(("radio0", 0))
device.settimeout(1.0)
print("listens", flush=True)
while True:
    try:
        frame, (_, _, kind, *_) = device.recvfrom(2048)
    except TimeoutError:
        break
    if kind != socket.PACKET_OUTGOING:
        print(frame[12:14].hex())
"""


def round_trips_s(ping: subprocess.CompletedProcess[str]) -> list[float]:
    return [float(ms) / 1000 for ms in re.findall(r"time=([\d.]+) ms", ping.stdout)]


@needs_program("ping")
@pytest.mark.parametrize("to", ["10.77.0.2", "fd53:57::2"])
def test_ping_takes_the_radio_s_latency_twice_and_only_in_range(tmp_path, to):
    with running(tmp_path, line(3) + DISK + f"latency_s = {LATENCY_S}") as world:
        reached = world.on("line-0", "ping", "-c", "5", "-i", "0.1", to)
        beyond = world.on("line-0", "ping", "-c", "2", "-i", "0.1", "-W", "1", to[:-1] + "3")
        summary = world.end()
    assert reached.returncode == 0, reached.stdout
    assert beyond.returncode == 1, beyond.stdout
    times_s = round_trips_s(reached)
    assert len(times_s) == 5
    assert 2 * LATENCY_S < min(times_s) < 4 * LATENCY_S, times_s  # the shortest: other programs use the machine, too
    interfaces, radio = summary["interfaces"], summary["radio"]
    assert interfaces["sent"] == radio["sent"]
    assert interfaces["delivered"] == radio["fates"]["received"] == interfaces["delivery"]["count"]
    assert radio["fates"]["out_of_range"] > 0


@needs_program("ping")
def test_run_with_frames_and_messages_is_repeated_bit_for_bit(tmp_path):
    scenario = line(3).replace("still.py:Still", "chatter.py:Chatter") + DISK + "loss = 0.3\njitter_s = 0.01"
    with running(tmp_path, scenario, "--packets", "all", files={"chatter.py": CHATTER}) as world:
        world.on("line-0", "ping", "-c", "10", "-i", "0.05", "-s", "1000", world.address("line-1"))
        summary = world.end()
    again = repeat(tmp_path / "out")
    assert again.same
    assert summary["interfaces"]["sent"] > 10
    assert summary["radio"]["fates"] == again.result.radio.fates


def test_messages_stay_out_of_devices(tmp_path):
    scenario = line(2).replace("still.py:Still", "chatter.py:Chatter") + DISK
    with running(tmp_path, scenario, files={"chatter.py": CHATTER}) as world:
        sniff = world.command("line-1", sys.executable, "-c", SNIFFER)
        sniffer = subprocess.Popen(sniff, stdout=subprocess.PIPE, text=True)
        assert sniffer.stdout.readline() == "listens\n"
        world.on("line-0", "bash", "-c", "echo x > /dev/udp/10.77.0.2/9")
        types = sniffer.communicate(timeout=60)[0].split()
        radio = world.end()["radio"]
    assert "0800" in types
    assert set(types) <= {"0800", "0806", "86dd"}  # IPv4, ARP, IPv6
    assert radio["fates"]["received"] > len(types) + 5


def test_killed_world_leaves_neither_processes_nor_devices(tmp_path):
    with running(tmp_path, line(3) + DISK) as world:
        sleeps = "sleep 1000 & (setsid sleep 1000 &) ; sleep 1000"
        sleeper = subprocess.Popen(world.command("line-1", "sh", "-c", sleeps))
        descend = partial(psutil.Process(sleeper.pid).children, recursive=True)
        inside = until(descend, lambda children: len(children) >= 5)
        os.kill(world.process.pid, signal.SIGKILL)
        assert sleeper.wait(60) == 128 + signal.SIGKILL
        until(lambda: not any(process.is_running() for process in inside))
    assert not any(name.startswith("radio") for _, name in socket.if_nameindex())
    assert (tmp_path / "out" / INTERFACES).exists()
    late = world.on("line-0", "true")
    assert (late.returncode, late.stderr) == (125, "error: the run is over\n")


@needs_program("ping")
def test_several_runs_at_once_do_not_meet(tmp_path):
    folders = [tmp_path / name for name in "ab"]
    for folder in folders:
        folder.mkdir()
    with running(folders[0], line(2) + DISK) as one, running(folders[1], line(2, spacing_m=5.0) + DISK) as other:
        pings = [world.on("line-0", "ping", "-c", "1", "-W", "1", "10.77.0.2").returncode for world in (one, other)]
    assert pings == [0, 1]


def scenario_file(folder: Path, text: str) -> Path:
    (folder / "still.py").write_text(STILL)
    (folder / "scenario.toml").write_text(text)
    return folder / "scenario.toml"


def test_lockstep_several_seeds_and_networks_in_use_are_refused_in_a_line(tmp_path, monkeypatch):
    path = scenario_file(tmp_path, line(2) + DISK + "[radio.interface]")
    with refused_input(key="radio.interface", match="realtime 1"):
        run(path, out=tmp_path / "out")
    with refused_input("seeds"):
        run(path, realtime=1, seeds=2)
    monkeypatch.setattr(namespaces, "DEVICE", Path("/dev/net/none"))
    assert Simulation(path).plan.static.robots == 2  # to be checked and drawn, without rights to run it
    with refused_input(match="expected /dev/net/none: sudo modprobe tun"):
        run(path, realtime=1, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_descriptors_end_with_the_run(tmp_path):
    path = scenario_file(tmp_path, line(4) + DISK + "[radio.interface]")
    counts: list[int] = []
    for _ in range(3):
        run(path, realtime=1, overrides=["duration_s=0.1"])
        counts.append(psutil.Process().num_fds())
    assert all(later <= earlier for earlier, later in pairwise(counts[1:])), counts
