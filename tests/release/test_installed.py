"""The distributions work where nothing else of this project is: for whoever emulates, and on a robot."""

import json
import re
from collections.abc import Generator
from contextlib import contextmanager
from subprocess import PIPE, Popen

from tests.release.built import Installed, bare

ON_ROBOTS = {"eclipse-zenoh", "msgpack", "msgspec", "numpy", "swarmwire-agent", "swarmwire-comms"}
QUICK = ("--set", "duration_s=0.5", "--set", "physics.engine=pymunk")
PLACES = "import json, sys, swarmwire; print(json.dumps([sys.prefix, *swarmwire.__path__]))"
LISTED = "import importlib.metadata as m, json; print(json.dumps([of.name for of in m.distributions()]))"
DEPLOYED = "from swarmwire.deploy.robots.packages import swarmwire_entries as o; print(*(e.name for e in o()))"
AGENT = """
from swarmwire.agent import Agent

class Mine(Agent):
    needs = ("proximity",)

    def step(self, robot):
        robot.drive(linear_mps=0.05 * (1 - max(robot.proximity.value)), angular_radps=0.5)
"""
SCENARIO = """
format = 1
name = "mine"
duration_s = 1.0
arena = { size_m = [3.0, 3.0] }
robots.few = { body = "epuck", count = 3, agent = "mine.py:Mine" }
"""


def stands_alone(installed: Installed) -> None:
    """Nothing of the sources is in reach."""
    prefix, *places = json.loads(installed.python(PLACES))
    assert len(places) == 1
    assert places[0].startswith(prefix)


@contextmanager
def world(installed: Installed) -> Generator[tuple["Popen[str]", str]]:
    """A world of the scenario, and where it listens; it is ended with the test."""
    command = [installed.program("swarmwire"), "world", "mine.toml", "--set", "physics.engine=pymunk"]
    command += ["--listen", "tcp/127.0.0.1:0", "--out", "together"]
    with Popen(command, cwd=installed.cwd, env=bare(), stdout=PIPE, stderr=PIPE, text=True) as process:
        try:
            line = next(line for line in process.stdout if "listens at" in line)
            [endpoint] = re.findall(r"listens at (\S+)[,;]", line)
            yield process, endpoint
        finally:
            process.kill()


def test_installed_commands_make_run_and_verify_a_scenario(everything: Installed) -> None:
    stands_alone(everything)
    assert "Usage: swarmwire" in everything.run("swarmwire", "--help")
    assert "turtlebot3-burger" in everything.run("swarmwire", "list", "bodies")
    everything.run("swarmwire", "new", "mine")
    everything.run("swarmwire", "run", "mine/scenario.toml", *QUICK, "--out", "first", "--quiet")
    summary = json.loads((everything.cwd / "first" / "summary.json").read_text())
    assert (summary["ended"], summary["ticks"]) == ("duration", 5)
    assert "intact: everything is there" in everything.run("swarmwire", "verify", "first")


def test_robot_files_to_deploy_are_found_in_the_installation(everything: Installed) -> None:
    deployed = everything.python(DEPLOYED).split()
    assert {"swarmwire/agent/py.typed", "swarmwire/comms/robot/bodies/epuck2.toml"} <= set(deployed)
    assert sum(name.endswith("METADATA") for name in deployed) == 2


def test_robot_installation_has_no_heavy_packages_and_runs_agents(robot: Installed) -> None:
    stands_alone(robot)
    assert set(json.loads(robot.python(LISTED))) == ON_ROBOTS
    (robot.cwd / "mine.py").write_text(AGENT)
    output = robot.run("swarmwire-agent", "check", "mine.py:Mine", "--driver", "epuck2", "--address", "192.0.2.1")
    assert output.startswith("robot-0: mine.py:Mine on epuck2")


def test_world_runs_with_a_runner_of_the_robot_installation(everything: Installed, robot: Installed) -> None:
    (robot.cwd / "mine.py").write_text(AGENT)
    (robot.cwd / "mine.toml").write_text(SCENARIO)
    with world(everything) as (process, endpoint):
        assert "the run is over" in robot.run("swarmwire-agent", "join", endpoint)
        _, errors = process.communicate(timeout=60.0)
    assert process.returncode == 0, errors
    assert json.loads((robot.cwd / "together" / "summary.json").read_text())["ended"] == "duration"
