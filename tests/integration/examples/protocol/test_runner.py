"""A runner written by docs/protocol.md alone plays as well as one of swarmwire."""

import ast
import subprocess
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from examples.protocol.runner import BROADCAST, TAG, VERSION
from swarmwire.agent.behaviours.flocking import Heading
from swarmwire.comms import packets
from swarmwire.comms.wire import frames
from swarmwire.deploy import backends, repeat, run
from swarmwire.deploy.config import Listening
from swarmwire.deploy.runners import RunnerProcesses
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario
from tests.integration.examples.test_examples import EXAMPLES
from tests.support.deploy.joiners import HERE, Joiners

PROGRAM = EXAMPLES / "protocol" / "runner.py"
OWN = 3  # robots that it plays


class Mixed:
    """Runners of swarmwire, but for one robot fewer of them each: the last is a process of the example."""

    def __init__(
        self, endpoint: str, run_id: str, agents: Sequence[str], names: Sequence[str], *, waited_for: bool
    ) -> None:
        assert waited_for
        self._others = RunnerProcesses(endpoint, run_id, agents, names[:-1])
        self._own = subprocess.Popen([sys.executable, str(PROGRAM), endpoint, "--name", "foreign"])

    def trouble(self) -> str | None:
        """None: a runner that is missing is told of by the time-out."""
        return self._others.trouble()

    def stop(self) -> None:
        """End them; the example leaves by itself when the run ends."""
        self._others.stop()
        try:
            self.code = self._own.wait(10.0)
        finally:
            self._own.kill()
            self._own.wait()


def scenario(**changes: object) -> Scenario:
    return load_scenario(EXAMPLES / "protocol" / "flock.toml").model_copy(update={"duration_s": 6.0, **changes})


@pytest.fixture
def mixed(monkeypatch: pytest.MonkeyPatch) -> list[Mixed]:
    """What started the runners of the runs of this test."""
    started: list[Mixed] = []

    def start(*given: Any, **more: Any) -> Mixed:
        started.append(Mixed(*given, **more))
        return started[-1]

    monkeypatch.setattr(backends, "RunnerProcesses", start)
    return started


def test_a_world_plays_with_it_as_with_an_agent_of_the_same_rule(mixed: list[Mixed]) -> None:
    boids = scenario()
    boids = boids.model_copy(
        update={
            "robots": {
                "flock": boids.robots["flock"].model_copy(
                    update={"agent": "tests.support.examples.protocol.boids:Boid"}
                )
            }
        }
    )
    alone, together = run(boids), run(boids, runners=2)
    assert mixed[0].code == 0
    assert together.trajectory_sha256 == alone.trajectory_sha256
    assert together.counts == alone.counts
    assert together.radio is not None
    assert together.radio.fates["received"] > 2000


def test_its_robots_and_those_of_swarmwire_hear_one_another(mixed: list[Mixed]) -> None:
    assert Heading.tag == TAG
    result = run(scenario(), runners=2)
    assert mixed[0].code == 0
    assert not {name for name in result.counts if name.endswith("_frames")}
    order = result.metrics["order"].final
    assert order is not None
    assert order > 0.9


def test_it_needs_nothing_but_zenoh_and_msgpack_and_is_short() -> None:
    text = PROGRAM.read_text(encoding="utf-8")
    modules = [alias.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import) for alias in node.names]
    modules += [str(node.module) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
    assert {name for name in modules if name.split(".")[0] not in sys.stdlib_module_names} == {"msgpack", "zenoh"}
    assert len(text.splitlines()) < 150
    assert (VERSION, BROADCAST) == (frames.VERSION, packets.BROADCAST)


class Both(Joiners):
    """The example, and a runner of swarmwire for the robots that it leaves."""

    def start(self, name: str, *arguments: str | Path, label: str = "") -> None:
        if name != "foreign":
            super().start(name, *arguments, label=label)
            return
        command = [sys.executable, str(PROGRAM), self.endpoint, "--name", name, *map(str, arguments)]
        self.processes[name] = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def test_what_it_does_is_recorded_so_that_repeat_gives_the_same_run(tmp_path: Path) -> None:
    """Its code is not in the run folder, and the scenario's agent does something else."""
    joiners = Both(tmp_path)
    joiners.first = [("foreign", "--robots", str(OWN)), ("own",)]
    flock = EXAMPLES / "protocol" / "flock.toml"
    with closing(joiners):
        listening = Listening(HERE, observer=joiners)
        result = run(flock, overrides=["duration_s=3"], listening=listening, out=tmp_path / "run")
    assert result.runner_events[0].runner == "foreign"
    assert result.inputs is not None
    assert result.inputs.first_tick == 0
    assert result.trajectory_sha256 != run(flock, overrides=["duration_s=3"]).trajectory_sha256
    assert repeat(tmp_path / "run").same
