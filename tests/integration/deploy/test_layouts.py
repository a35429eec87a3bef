"""Runs in other layouts: processes, movable obstacles, told values, rehearsals."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.wire.assignment import split
from swarmwire.deploy import Recording, Result, repeat, run
from swarmwire.deploy.runs.live_address import local_endpoint, new_run_id
from swarmwire.deploy.runs.runners import RunnerProcesses
from swarmwire.deploy.runs.scenario_parts import agent_specs, new_medium
from swarmwire.deploy.runs.simulation import Simulation
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.pictures.drawing.film import film_of
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.verify import verify
from swarmwire.world.backends import allocation as assignments
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.zenoh_backend import LockstepBackend
from swarmwire.world.loop import Loop
from tests.support.deploy.runs import LOSSY, PER_ROBOT, ROOT, run_spread

SHORT = ["duration_s=3"]
SCENARIOS = sorted((ROOT / "scenarios").glob("*.toml"))
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


@pytest.fixture(scope="module")
def local() -> Result:
    return run(LOSSY, overrides=SHORT)


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda path: path.stem)
@pytest.mark.parametrize("runners", [3, "per-robot"])
def test_scenario_runs_alike_in_one_process_and_in_many(scenario, runners):
    one_second = ["duration_s=1"]
    alone = run(scenario, overrides=one_second).trajectory_sha256
    assert run(scenario, overrides=one_second, runners=runners).trajectory_sha256 == alone


def test_custom_agent_of_the_same_rule_gives_the_same_run(local):
    mine = f"robots.flock.agent={ROOT / 'examples' / 'flocking_agent.py'}:MyFlocking"
    assert run(LOSSY, overrides=[*SHORT, mine], runners="per-robot").trajectory_sha256 == local.trajectory_sha256


def test_arena_is_the_same_alone_and_as_one_of_eight(local):
    eight = run(LOSSY, overrides=SHORT, seeds=range(1, 9), runners=3)
    assert eight.trajectory_sha256[0] == local.trajectory_sha256[0]
    assert eight.arenas[0].radio == local.radio
    assert eight.arenas[0].metrics == local.metrics


def test_assignment_of_robots_to_runners_does_not_change_the_run(local):
    """Runners get robots in the order in which they come: handing them out backwards is the other order of starting."""
    simulation = Simulation(LOSSY, overrides=SHORT)
    specs = agent_specs(simulation.plan.scenario)
    parts = split(assignments.full_assignment(simulation.plan.scenario, simulation.world.static, specs), 3)
    run_id = new_run_id()
    with local_endpoint() as endpoint:
        backend = LockstepBackend(endpoint, run_id, Lockstep(parts[::-1]), 30.0, WallClock())
        backend.open()
        hosts = [RunnerProcesses(endpoint, run_id, sorted(specs.values()), 2, name=name) for name in "cba"]
        try:
            backend.start()
            loop = Loop(
                simulation.world, new_medium(simulation.plan.scenario, simulation.world, traces=None), backend, []
            )
            loop.run(simulation.plan.ticks)
        finally:
            backend.close()
            for host in hosts:
                host.stop()
    assert loop.hexdigests() == local.trajectory_sha256


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
        assert truth.movable is not None
        assert truth.edges is not None
        [(x, _, _)] = truth.movable[0].tolist()
        passed += abs(x - 0.3) < 0.03
        joined = BETWEEN in np.sort(truth.edges, axis=1).tolist()
        if abs(x - 0.3) < 0.03:
            assert not joined
        if x < 0.2:
            assert joined
    assert passed > 5


def test_movable_box_is_recorded_and_drawn_where_it_is(scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    result = run(scenario, out=out, record=Recording(rrd=False))
    assert result.engine == "pymunk"
    folder = RunFolder(out)
    film = film_of(folder, 0, "")
    assert film.movable is not None
    assert film.movable.shape == (120, 1, 3)
    assert film.movable[0, 0].tolist() == [0.0, 0.0, 0.0]
    [box] = film.movable_at(119)
    assert (box.shape, box.size_m) == ("box", (0.1, 0.4))
    assert box.x_m > 0.2
    assert "movable_x_m" not in folder.metrics().columns
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    from swarmwire.metrics.pictures.drawing.animation import FilmFigure
    from tests.integration.metrics.drawing.test_animation import FLOOR, MOVABLE, color_at

    figure = FilmFigure(film, 640)
    side_m = 0.15  # along the box from its middle: there the pusher does not hide it
    c, s = np.cos(box.heading_rad), np.sin(box.heading_rad)
    places = (0.0, side_m), (box.x_m - s * side_m, box.y_m + c * side_m)
    for index, colors in ((0, [MOVABLE, FLOOR]), (119, [FLOOR, MOVABLE])):
        image = figure.frame(index).copy()
        assert [color_at(figure, image, *place) for place in places] == colors


def test_runs_with_movable_obstacles_are_the_same_in_every_layout(scenario: Path) -> None:
    alone = run(scenario, seeds=[7])
    assert alone.ended == "duration"
    assert run_spread(scenario, 2, seeds=[7]).trajectory_sha256 == alone.trajectory_sha256
    assert run(scenario, seeds=[5, 7]).trajectory_sha256[1:] == alone.trajectory_sha256


class Kept(Observer):
    """Observer that keeps the numbers of all ticks, and how far they are apart."""

    def __init__(self) -> None:
        self.values: list[FloatArray | None] = []
        self.errors: list[float] = []
        self._metrics = Metrics(["consensus_error"])

    def begin(self, static: Static) -> None:
        self._metrics.begin(static)

    def see(self, truth: Truth) -> None:
        self._metrics.see(truth)
        self.errors.append(float(self._metrics.latest["consensus_error"][-1]))
        self.values.append(truth.value)


@pytest.fixture
def agents(tmp_path: Path) -> Path:
    (tmp_path / "agents.py").write_text(AGREEING)
    return tmp_path / "agents.py"


def kept(agents: Path, kind: str, runners: int | None, seeds: list[int], out: Path | None = None) -> Kept:
    seen = Kept()
    setting = [f"robots.flock.agent={agents}:{kind}", "robots.flock.params={}", "duration_s=3"]
    run_spread(LOSSY, runners, seeds=seeds, overrides=setting, observers=[seen], out=out, record=LEAN)
    return seen


def as_bytes(ticks: list[FloatArray | None]) -> list[bytes | None]:
    return [None if value is None else value.tobytes() for value in ticks]


@pytest.mark.parametrize("kind", ["Agreeing", "Turning"])
@pytest.mark.parametrize("runners", [3, PER_ROBOT])
def test_told_values_are_the_same_in_every_layout_bit_for_bit(agents: Path, kind: str, runners: int) -> None:
    alone, spread = (kept(agents, kind, where, [2]) for where in (None, runners))
    assert as_bytes(spread.values) == as_bytes(alone.values)
    assert alone.values[-1] is not None
    assert np.isfinite(alone.values[-1]).any()


def test_told_values_are_the_same_beside_other_arenas(agents: Path) -> None:
    alone, beside = (kept(agents, "Agreeing", None, seeds) for seeds in ([2], [5, 2]))
    own = [None if value is None else value[len(value) // 2 :] for value in beside.values]
    assert as_bytes(own) == as_bytes(alone.values)
    assert beside.errors == alone.errors


def test_consensus_reduces_disagreement(agents: Path) -> None:
    errors = kept(agents, "Agreeing", None, [2]).errors
    assert 0.0 < errors[-1] < 0.5 * errors[0]


def test_told_values_are_recorded_from_the_first_on_and_repeated(agents: Path, tmp_path: Path) -> None:
    seen, folder = kept(agents, "Turning", 2, [2, 3], tmp_path / "run"), tmp_path / "run"
    assert all(finding.good for finding in verify(folder)), verify(folder)
    table = RunFolder(folder).ticks(1)
    expected = [
        [None] * 20 if value is None else [None if np.isnan(one) else one for one in value[20:].tolist()]
        for value in seen.values
    ]
    assert table["value"].to_list() == expected
    assert seen.values[0] is None
    assert repeat(folder, out=tmp_path / "again", record=LEAN).same
    assert RunFolder(tmp_path / "again").ticks(1)["value"].to_list() == expected
