"""Agents that fly Crazyflies of a run, each in a process of its own."""

import os
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

from tests.support.agent.on_robot.installed import Command
from tests.support.clocks import until

AGENT = """
from swarmwire.agent import Agent, Message, Robot, i2

class Beacon(Message):
    number: i2

class Calling(Agent):
    def step(self, robot: Robot) -> None:
        robot.drive(0.1, 0.0)
        robot.radio.send(Beacon(number=1))
        if robot.radio.received(Beacon):
            robot.note("received")
"""
SCENARIO = """
format = 1
name = "two"
duration_s = 600.0
[time]
rate_hz = 20
[arena]
size_m = [4.0, 4.0]
[robots.cf]
body = "crazyflie"
count = 2
place = { how = "poses", poses = [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]] }
agent = "calling.py:Calling"
[radio]
range_m = 3.0
"""


def test_crazyflie_agents_send_packets_over_the_robots_own_network(tmp_path: Path) -> None:
    (tmp_path / "calling.py").write_text(AGENT)
    (tmp_path / "two.toml").write_text(SCENARIO)
    run = [sys.executable, "-m", "swarmwire.deploy", "run", tmp_path / "two.toml", "--gateway", "crazyflie"]
    out = ("--out", tmp_path / "run", "--no-rrd")
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)}
    with ExitStack() as closing:
        world = subprocess.Popen([*run, *out], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        closing.callback(world.communicate)
        closing.callback(world.send_signal, signal.SIGINT)
        assert any(line.startswith("cf-1") for line in world.stdout)
        for name in ("cf-0", "cf-1"):
            config = ("--config", str(tmp_path / "run" / "robots" / f"{name}.toml"))
            log = ("--log", str(tmp_path / "logs"), "--radio", "zenoh", "--watchdog-s", "5")
            closing.enter_context(Command(environment, "run", *config, *log))

        def received() -> int:
            return sum(",received," in ticks.read_text() for ticks in (tmp_path / "logs").glob("cf-*/ticks.csv"))

        until(lambda: received() == 2)
