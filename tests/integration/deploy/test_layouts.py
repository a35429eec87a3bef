"""Runs in other layouts: processes, movable obstacles, noted values."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.deploy import Recording, repeat, run
from swarmwire.deploy.runs.simulation import Simulation
from swarmwire.metrics.pictures.drawing.film import film_of
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.verify import verify
from tests.support.deploy.joiners import Watcher
from tests.support.deploy.runs import LOSSY, PER_ROBOT, ROOT, run_spread

PUSHER = """
from swarmwire.agent import Agent

class Pusher(Agent):
    needs = ("compass",)

    def step(self, robot):
        if abs(robot.compass.heading_rad) < 0.1:
            robot.drive(0.1, 0.0)
"""
SCENARIO = """
format = 1
name = "a box between two"
duration_s = 12.0

[arena]
size_m = [4.0, 4.0]
obstacles = [
    { shape = "cylinder", radius_m = 0.1, at = [-1.5, 1.5] },
    { shape = "box", size_m = [0.1, 0.4], at = [0.0, 0.0], movable = true, mass_kg = 0.05 },
]

[robots.a]
body = "epuck"
count = 3
agent = "pusher.py:Pusher"
place = { how = "poses", poses = [[-0.4, 0.0, 0.0], [0.3, 1.0, 1.5], [0.3, -1.0, 1.5]] }

[radio]
range_m = 2.5
"""
BETWEEN = [1, 2]  # the robots between which the box is pushed
AGREEING = """
import numpy as np

from swarmwire.agent import Agent, Message, VectorAgent, f8

class Estimate(Message):
    value: f8

class Agreeing(Agent):
    needs = ("compass",)
    value = None

    def step(self, robot):
        received = robot.radio.received(Estimate)
        if self.value is None:
            self.value = robot.compass.heading_rad
        self.value += 0.05 * sum(packet.message.value - self.value for packet in received)
        robot.note(state="agreeing", value=self.value)
        robot.radio.send(Estimate(value=self.value))
        robot.drive(0.0, 0.0)

class Turning(VectorAgent):
    needs = ("compass",)

    def step(self, robots, memory):
        late = np.full(robots.n, robots.time_s >= 1.0)
        robots.note(value=robots.compass.heading_rad, rows=late & (robots.compass.heading_rad > 0))
        robots.drive(0.0, 0.4)
"""
LEAN = Recording(rrd=False)


@pytest.mark.parametrize("name", ["avoidance", "flocking-802154", "flocking-disrupted", "pso"])
def test_scenario_runs_alike_in_one_process_and_in_one_per_robot(name: str) -> None:
    scenario, short = ROOT / "scenarios" / f"{name}.toml", ["duration_s=1"]
    alone = run(scenario, overrides=short).trajectory_sha256
    assert run(scenario, overrides=short, runners="per-robot").trajectory_sha256 == alone


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    (tmp_path / "pusher.py").write_text(PUSHER)
    (tmp_path / "box.toml").write_text(SCENARIO)
    return tmp_path / "box.toml"


def test_box_that_is_pushed_between_two_robots_blocks_their_radio(scenario: Path) -> None:
    with Simulation(scenario) as simulation:
        truths = [simulation.step() for _ in range(simulation.plan.ticks)]
    passed = 0
    for truth in truths:
        assert truth.edges is not None
        [(x, _, _)] = truth.movable[0].tolist()
        passed += abs(x - 0.3) < 0.03
        joined = BETWEEN in np.sort(truth.edges, axis=1).tolist()
        if abs(x - 0.3) < 0.03:
            assert not joined
        if x < 0.2:
            assert joined
    assert passed > 5


def test_movable_box_is_recorded_where_it_is(scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    result = run(scenario, out=out, record=Recording(rrd=False))
    assert result.engine == "pymunk"
    folder = RunFolder(out)
    film = film_of(folder, 0, "")
    assert film.movable.shape == (120, 1, 3)
    assert film.movable[0, 0].tolist() == [0.0, 0.0, 0.0]
    [box] = film.movable_at(119)
    assert (box.shape, box.size_m) == ("box", (0.1, 0.4))
    assert box.x_m > 0.2
    assert "movable_x_m" not in folder.metrics().columns


def test_runs_with_movable_obstacles_are_the_same_in_every_layout(scenario: Path) -> None:
    alone = run(scenario, seeds=[7])
    assert alone.ended == "duration"
    assert run_spread(scenario, 2, seeds=[7]).trajectory_sha256 == alone.trajectory_sha256
    assert run(scenario, seeds=[5, 7]).trajectory_sha256[1:] == alone.trajectory_sha256


@pytest.fixture
def agents(tmp_path: Path) -> Path:
    (tmp_path / "agents.py").write_text(AGREEING)
    return tmp_path / "agents.py"


def values(
    agents: Path, kind: str, runners: int | None, seeds: list[int], out: Path | None = None
) -> list[FloatArray | None]:
    """The numbers that agents of this kind note, by tick."""
    watcher = Watcher()
    setting = [f"robots.flock.agent={agents}:{kind}", "robots.flock.params={}", "duration_s=3"]
    run_spread(LOSSY, runners, seeds=seeds, overrides=setting, observers=[watcher], out=out, record=LEAN)
    return [truth.value for truth in watcher.truths]


def as_bytes(ticks: list[FloatArray | None]) -> list[bytes | None]:
    return [None if value is None else value.tobytes() for value in ticks]


@pytest.mark.parametrize(("kind", "runners"), [("Agreeing", PER_ROBOT), ("Turning", 3)])
def test_noted_values_are_the_same_in_every_layout_bit_for_bit(agents: Path, kind: str, runners: int) -> None:
    layouts = (None, [2]), (runners, [2]), (None, [5, 2])
    alone, spread, beside = (values(agents, kind, where, seeds) for where, seeds in layouts)
    assert as_bytes(spread) == as_bytes(alone)
    assert as_bytes([None if value is None else value[len(value) // 2 :] for value in beside]) == as_bytes(alone)
    assert alone[-1] is not None
    assert np.isfinite(alone[-1]).any()


def test_noted_values_are_recorded_from_the_first_on_and_repeated(agents: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    numbers = values(agents, "Turning", 2, [2, 3], folder)
    assert all(finding.good for finding in verify(folder)), verify(folder)
    table = RunFolder(folder).ticks(1)
    arena = [np.full(20, np.nan) if value is None else value[20:] for value in numbers]
    expected = [[None if np.isnan(one) else one for one in value.tolist()] for value in arena]
    assert table["value"].to_list() == expected
    assert numbers[0] is None
    assert repeat(folder, out=tmp_path / "again", record=LEAN).same
    assert RunFolder(tmp_path / "again").ticks(1)["value"].to_list() == expected
