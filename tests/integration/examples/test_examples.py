"""The examples."""

import ast
import os
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import polars as pl
import pytest
from nbclient import NotebookClient

from examples.loss_sweep import FLOCK, LOSSES, table
from examples.protocol.runner import BROADCAST, TAG, VERSION
from swarmwire.agent.behaviours.flocking import Heading
from swarmwire.comms.base import sentinels
from swarmwire.comms.robot.packets import Fate
from swarmwire.comms.wire import frames
from swarmwire.deploy import Result, Simulation, repeat, run
from swarmwire.deploy.runs.config import Listening
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario
from tests.support.deploy.joiners import LOCALHOST, Joiners

EXAMPLES = Path(__file__).parents[3] / "examples"
GAS = EXAMPLES / "gas" / "gas-leak.toml"
LAMP = EXAMPLES / "ways" / "lamp.toml"
PROGRAM = EXAMPLES / "protocol" / "runner.py"
OWN = 3  # robots that it plays
ROOT = Path(__file__).parents[3]
NODES = ROOT / "examples" / "ros2"
STAND_IN = ROOT / "tests" / "support" / "examples" / "ros2" / "stand_in"
PACE = 2.0
SCENARIO = """
format = 1
name = "two bases, each in front of a wall"
duration_s = 30.0

[arena]
size_m = [3.0, 3.0]

[robots.flock]
body = "BODY"
count = 2
place = { how = "poses", poses = [[0.8, 0.6, 0.0], [-0.8, -0.6, 3.14159]] }
agent = "idle.py:Idle" # of the world's own: ROS takes its place
"""
IDLE = """
from swarmwire.agent import Agent


class Idle(Agent):
    needs = ("scan", "odometry", "imu", "battery")

    def step(self, robot):
        pass
"""


def test_sweep_example_has_a_row_for_each_loss_and_seed():
    runs = table(FLOCK, 2, 2.0)
    assert runs.select("loss", "seed").rows() == [(loss, seed) for loss in LOSSES for seed in (1, 2)]
    delivered = runs.group_by("loss", maintain_order=True).agg(pl.col("link_pdr").mean())["link_pdr"]
    assert delivered.is_sorted(descending=True)
    assert runs.filter(pl.col("loss") == 0.0)["link_pdr"].to_list() == [1.0, 1.0]


def test_robots_with_an_own_sense_and_an_own_actuator_seal_the_leak():
    with Simulation(GAS) as leaking:
        for _ in range(leaking.plan.ticks):
            leaking.step()
        assert leaking.world.scene.shared["leak"].strength[0] < 0.05
        assert "sealing" in leaking.world.states.names


def test_leak_example_is_the_same_with_a_process_per_robot():
    alone, spread = (run(GAS, overrides=["duration_s=3"], runners=runners) for runners in (None, "per-robot"))
    assert spread.trajectory_sha256 == alone.trajectory_sha256


def test_leak_example_is_repeated_from_its_run_folder_alone(tmp_path):
    for file in GAS.parent.iterdir():
        if file.is_file():
            (tmp_path / file.name).write_bytes(file.read_bytes())
    run(tmp_path / GAS.name, overrides=["duration_s=3"], out=tmp_path / "run")
    for file in tmp_path.iterdir():
        if file.is_file():
            file.unlink()
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.changes == ()
    sheet = tmp_path / "run" / "files" / "gas.py"
    sheet.write_text(sheet.read_text() + "# changed\n")
    assert repeat(tmp_path / "run").changes == ("files/gas.py is not as the run left it: its sha256 differs",)


def test_sweep_example_prints_its_table():
    command = [sys.executable, EXAMPLES / "loss_sweep.py", "--seeds", "1", "--duration", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[0].split("|")[1:-1] == [" loss ", " link_pdr ", " order    ", " runs "]


# jupyter_client warns of what will change in its own event loop, tornado of the same.
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::RuntimeWarning")
def test_notebook_runs_from_top_to_bottom(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("PYTHONPATH", str(EXAMPLES.parent))
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    notebook = nbformat.read(EXAMPLES / "step_by_step.ipynb", as_version=4)
    NotebookClient(notebook, timeout=100, resources={"metadata": {"path": str(EXAMPLES)}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert outputs[-1]["data"]["text/plain"] == "True"
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
    assert not [output for output in outputs if output.output_type == "error"]


def run_of(way: str, duration_s: float) -> Result:
    return run(LAMP, overrides=[f"robots.seekers.agent='{way}.py:Seeker'", f"duration_s={duration_s}"])


@pytest.fixture(scope="module")
def plain() -> Result:
    return run_of("plain", 60.0)


def test_most_seekers_come_to_the_lamp(plain: Result):
    distance_m = plain.metrics["target_mean"]
    assert (distance_m.final or np.inf) < 0.5 * (distance_m.max or 0.0)


@pytest.mark.parametrize("way", ["state_machine", "behaviour_tree"])
def test_agent_styles_move_the_swarm_alike(way: str, plain: Result):
    assert run_of(way, 60.0).trajectory_sha256 == plain.trajectory_sha256


def scenario(**changes: object) -> Scenario:
    return load_scenario(EXAMPLES / "protocol" / "flock.toml").model_copy(update={"duration_s": 6.0, **changes})


class Both(Joiners):
    """The example, and a runner of swarmwire for the robots that it leaves."""

    def start(self, name: str, *arguments: str | Path, label: str = "") -> None:
        if name != "foreign":
            super().start(name, *arguments, label=label)
            return
        command = [sys.executable, str(PROGRAM), self.endpoint, "--name", name, *map(str, arguments)]
        self.processes[name] = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def with_own(folder: Path, flock: Scenario | Path, **more: Any) -> tuple[Result, int]:
    """A run of robots of the example and of swarmwire, and the exit code of the example."""
    joiners = Both(folder)
    joiners.first = [("foreign", "--robots", str(OWN)), ("own",)]
    with closing(joiners):
        result = run(flock, listening=Listening(LOCALHOST, observer=joiners), **more)
        return result, joiners.outcome("foreign")[0]


def test_foreign_program_plays_as_an_agent_of_the_same_rule_does(tmp_path: Path) -> None:
    """Beside a host with a process per robot."""
    flock = scenario().robots["flock"].model_copy(update={"agent": "tests.support.examples.protocol.boids:Boid"})
    boids = scenario(robots={"flock": flock})
    alone, (together, code) = run(boids), with_own(tmp_path, boids)
    assert code == 0
    assert together.trajectory_sha256 == alone.trajectory_sha256
    assert together.radio == alone.radio
    assert together.radio.fates["received"] > 2000


def test_foreign_robots_and_those_of_swarmwire_hear_one_another(tmp_path: Path) -> None:
    assert Heading.tag == TAG
    result, code = with_own(tmp_path, scenario())
    assert code == 0
    assert not {name for name in result.counts if name.endswith("_frames")}
    assert (result.metrics["order"].final or 0.0) > 0.9


def test_foreign_program_needs_only_zenoh_and_msgpack_and_is_short() -> None:
    text = PROGRAM.read_text(encoding="utf-8")
    modules = [alias.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import) for alias in node.names]
    modules += [str(node.module) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
    assert {name for name in modules if name.split(".")[0] not in sys.stdlib_module_names} == {"msgpack", "zenoh"}
    assert len(text.splitlines()) < 155
    assert (VERSION, BROADCAST) == (frames.VERSION, sentinels.BROADCAST)


def test_foreign_program_is_recorded_so_that_repeat_gives_the_same_run(tmp_path: Path) -> None:
    """Its code is not in the run folder, and the scenario's agent does something else."""
    flock = EXAMPLES / "protocol" / "flock.toml"
    result, _ = with_own(tmp_path, flock, overrides=["duration_s=3"], out=tmp_path / "run")
    assert result.runner_events[0].runner == "foreign"
    assert result.inputs.first_tick == 0
    assert result.trajectory_sha256 != run(flock, overrides=["duration_s=3"]).trajectory_sha256
    assert repeat(tmp_path / "run").same


@contextmanager
def node(example: str, transport: str, endpoint: str, namespace: str, *parameters: str) -> Generator[list[str]]:
    """The example in a process of its own, interrupted in the end as by Ctrl-C; gets the lines of its log then."""
    paths, log = os.pathsep.join([str(STAND_IN), str(ROOT)]), list[str]()
    environment = {**os.environ, "PYTHONPATH": paths, "ROS_STAND_IN": f"{transport} {endpoint}"}
    command = [sys.executable, str(NODES / example), "--ros-args", "-r", f"__ns:={namespace}", *parameters]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield log
    finally:
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=30)
        log += output.splitlines()
        assert (process.returncode, errors) == (0, "")


@pytest.mark.parametrize(("body", "scanner_deg"), [("turtlebot3-burger", 0.0), ("turtlebot4", 90.0)])
def test_ros2_example_drives_ahead_and_turns_before_walls(body, scanner_deg, tmp_path):
    (tmp_path / "two.toml").write_text(SCENARIO.replace("BODY", body))
    (tmp_path / "idle.py").write_text(IDLE)
    with Simulation(tmp_path / "two.toml") as compiled:  # in real time it would be behind at once
        compiled.run(2)
    with Simulation(tmp_path / "two.toml", gateways="ros2", realtime=PACE) as simulation:
        assert simulation.served
        endpoints = [robot.address for robot in simulation.served.robots]
        scanner = ("-p", f"scanner_deg:={scanner_deg}")
        by_rmw = node("drive_and_turn.py", "rmw", endpoints[0], "/flock_0", *scanner)
        with by_rmw, node("drive_and_turn.py", "bridge", endpoints[1], "/flock_1", *scanner):
            gone_m, turned_rad = np.zeros(2), np.zeros(2)
            while not ((gone_m > 0.15).all() and (turned_rad > 0.5).all()):
                assert simulation.tick < simulation.plan.ticks, f"driven {gone_m} m, turned {turned_rad} rad"
                before = simulation.world.pose
                simulation.step()
                by = simulation.world.pose - before
                gone_m += np.hypot(by[:, 0], by[:, 1])
                turned_rad += np.abs(np.remainder(by[:, 2] + np.pi, 2 * np.pi) - np.pi)
                assert np.abs(simulation.world.pose[:, :2]).max() < 1.3, "it drove into a wall"


def test_ros2_nodes_count_together_over_the_radio(tmp_path):
    """One starts later, and goes on from the count that it hears of the other."""
    text = SCENARIO.replace("BODY", "turtlebot3-burger") + "[radio]\nrange_m = 5.0\nmeasures = { range = {} }\n"
    (tmp_path / "two.toml").write_text(text)
    (tmp_path / "idle.py").write_text(IDLE)
    with Simulation(tmp_path / "two.toml", gateways="ros2", realtime=1.0) as simulation:

        def step_until(received: int) -> None:
            done = 0
            while done < received:
                truth = simulation.step()
                done += int(truth.tally.fates[0, Fate.RECEIVED]) if truth.tally else 0
                assert simulation.tick < simulation.plan.ticks

        assert simulation.served
        endpoint = simulation.served.robots[0].address
        with node("count_over_radio.py", "rmw", endpoint, "/flock_0") as first_log:
            step_until(3)
            with node("count_over_radio.py", "bridge", endpoint, "/flock_1") as second_log:
                step_until(8)
    counts = [int(line.split()[0]) for line in first_log]
    assert counts == sorted(counts)
    assert counts[-1] > len(counts) + 1  # more than it can have counted by itself
    assert all(" from flock_1 range_m=2" in line for line in first_log)  # the bases are 2 m apart
    assert all(" from flock_0 range_m=2" in line for line in second_log)
