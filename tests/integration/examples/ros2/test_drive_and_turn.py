"""The example node drives robots of a world, as a node of rmw_zenoh and as one behind a bridge."""

import os
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from swarmwire.deploy import Simulation

ROOT = Path(__file__).parents[4]
EXAMPLE = ROOT / "examples" / "ros2" / "drive_and_turn.py"
STAND_IN = ROOT / "tests" / "support" / "examples" / "ros2" / "stand_in"
PACE = 2.0
SCENARIO = """
format = 1
name = "two bases, each in front of a wall"
duration_s = 30.0

[arena]
size_m = [3.0, 3.0]

[robots.flock]
body = "turtlebot3-burger"
count = 2
place = { how = "poses", poses = [[0.8, 0.6, 0.0], [-0.8, -0.6, 3.14159]] }
agent = "idle.py:Idle" # of the world's own: ROS takes its place
"""
IDLE = """
from swarmwire.agent import Agent


class Idle(Agent):
    needs = ("scan", "odometry", "imu", "compass", "battery")

    def step(self, robot):
        pass
"""


@contextmanager
def node(transport: str, endpoint: str, namespace: str) -> Generator[subprocess.Popen[str]]:
    """The example in a process of its own, interrupted in the end as by Ctrl-C."""
    paths = os.pathsep.join([str(STAND_IN), str(ROOT)])
    command = [sys.executable, str(EXAMPLE), "--ros-args", "-r", f"__ns:={namespace}"]
    process = subprocess.Popen(
        command,
        env={**os.environ, "PYTHONPATH": paths, "ROS_STAND_IN": f"{transport} {endpoint}"},
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30)
        assert (process.returncode, errors) == (0, "")


def test_the_example_drives_ahead_and_turns_before_walls(tmp_path):
    (tmp_path / "two.toml").write_text(SCENARIO)
    (tmp_path / "idle.py").write_text(IDLE)
    with Simulation(tmp_path / "two.toml") as compiled:  # in real time it would be behind at once
        compiled.run(2)
    with Simulation(tmp_path / "two.toml", gateways="ros2", realtime=PACE) as simulation:
        assert simulation.served
        endpoints = [robot.address for robot in simulation.served.robots]
        with node("rmw", endpoints[0], "/flock_0"), node("bridge", endpoints[1], "/flock_1"):
            gone_m, turned_rad = np.zeros(2), np.zeros(2)
            while not ((gone_m > 0.15).all() and (turned_rad > 0.5).all()):
                assert simulation.tick < simulation.ticks, f"driven {gone_m} m, turned {turned_rad} rad"
                before = simulation.world.pose
                simulation.step()
                by = simulation.world.pose - before
                gone_m += np.hypot(by[:, 0], by[:, 1])
                turned_rad += np.abs(np.remainder(by[:, 2] + np.pi, 2 * np.pi) - np.pi)
                assert np.abs(simulation.world.pose[:, :2]).max() < 1.3, "it drove into a wall"
