"""Law 2: the same scenario and seed give the same run bit for bit, however robots and arenas are split."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pytest

from swarmwire.comms.base.threads import WORTH_ROWS
from swarmwire.deploy import Result, Simulation, run
from swarmwire.deploy.runs import backends
from swarmwire.world.scenario_file import load_scenario
from tests.support.agent.hosts import PLAYERS
from tests.support.deploy.joiners import Watcher
from tests.support.deploy.runs import DISRUPTED, DISRUPTED_SHORT, LOSSY, PER_ROBOT, ROOT, run_spread
from tests.support.refusals import refused_input
from tests.support.world.locksteps import EncodedBackend

SHORT = ["duration_s=1.5"]
SCENARIOS = sorted(
    path
    for folder in (".", "behaviours", "papers/scenarios", "robots")
    for path in (ROOT / "scenarios" / folder).glob("*.toml")
    if path.stem not in ("turtlebot", "turtlebot4", "crazyflie")  # bodies that lie among them
)


@pytest.fixture(scope="module")
def local() -> Result:
    return run(LOSSY, overrides=SHORT)


def encoded(monkeypatch: pytest.MonkeyPatch, scenario: Path, **options) -> Result:
    """A run through frames, with its robots in three parts, unless `given` says otherwise."""
    seeds = options.pop("seeds", None)
    overrides = options.pop("overrides", SHORT)
    with monkeypatch.context() as patched:
        patched.setattr(backends, "LocalBackend", partial(EncodedBackend, **options))
        result = run(scenario, overrides=overrides, seeds=seeds)
    assert not any(name.endswith("_frames") for name in result.counts), result.counts
    return result


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda path: path.stem)
def test_shipped_scenarios_run_alike_through_frames(monkeypatch, scenario):
    """For seven ticks: what is sent in one is received in the next or, with a latency, a few later."""
    short = [f"duration_s={7 / load_scenario(scenario).time.rate_hz}"]
    through_frames = encoded(monkeypatch, scenario, overrides=short)
    directly = run(scenario, overrides=short)
    assert through_frames.trajectory_sha256 == directly.trajectory_sha256
    assert [arena.radio for arena in through_frames.arenas] == [arena.radio for arena in directly.arenas]


def test_assignment_of_robots_to_parts_does_not_matter(monkeypatch, local):
    result = encoded(monkeypatch, LOSSY, backwards=True)
    assert result.trajectory_sha256 == local.trajectory_sha256
    assert (result.radio, result.metrics) == (local.radio, local.metrics)


def test_threads_do_not_change_the_run():
    """Of enough robots that their rays are worth another thread."""
    robots, arenas = 50, 200
    assert robots * arenas >= WORTH_ROWS
    overrides = ["duration_s=0.3", f"robots.wanderers.count={robots}", "arena.size_m=[6.0,6.0]"]
    avoidance = ROOT / "scenarios" / "avoidance.toml"
    one, two = (run(avoidance, overrides=overrides, seeds=arenas, threads=threads) for threads in (1, 2))
    assert one.trajectory_sha256 == two.trajectory_sha256
    assert len(set(one.trajectory_sha256)) == arenas


def test_fewer_threads_than_one_are_refused():
    with refused_input("threads"):
        run(LOSSY, threads=0)


def test_agent_of_a_user_with_the_same_rule_gives_the_same_run(local):
    mine = f"robots.flock.agent={ROOT / 'examples' / 'flocking_agent.py'}:MyFlocking"
    assert run(LOSSY, overrides=[*SHORT, mine]).trajectory_sha256 == local.trajectory_sha256


def test_arena_is_the_same_alone_and_as_one_of_eight(local):
    eight = run(LOSSY, overrides=SHORT, seeds=range(1, 9))
    assert eight.trajectory_sha256[0] == local.trajectory_sha256[0]
    assert eight.trajectory_sha256[4] == run(LOSSY, overrides=SHORT, seed=5).trajectory_sha256[0]
    assert (eight.arenas[0].radio, eight.arenas[0].metrics) == (local.radio, local.metrics)
    assert len(set(eight.trajectory_sha256)) == 8


def test_another_seed_or_another_loss_is_another_run(local):
    assert run(LOSSY, overrides=SHORT, seed=2).trajectory_sha256 != local.trajectory_sha256
    assert run(LOSSY, overrides=[*SHORT, "radio.loss=0.31"]).trajectory_sha256 != local.trajectory_sha256


MIXED = """
format = 1
name = "two rates"
duration_s = 6.0
arena = {{ size_m = [4.0, 4.0] }}

[robots.scouts]
body = "epuck"
count = 5
agent = "swarmwire.agent.behaviours:Flocking"
act_every_ticks = {scouts}
params = {{ separation_m = 0.8 }}

[robots.carriers]
body = "footbot"
count = 4
agent = "{carriers}"
act_every_ticks = {every}

[radio]
range_m = 3.0
loss = 0.2
latency_s = 0.05
measures = {{ range = {{ noise_m = 0.02 }}, bearing = {{ noise_rad = 0.05 }} }}
"""
COUNTING = """
from swarmwire.agent import Agent, Message, f4

class Word(Message):
    number: f4

class Counting(Agent):
    needs = ("odometry",)

    def __init__(self):
        self.steps = self.words = 0

    def step(self, robot):
        assert round(robot.time_s / robot.period_s, 6) == self.steps
        times = [packet.received_at_ns for packet in robot.radio.received(Word)]
        assert times == sorted(times)
        assert all(robot.time_s - robot.period_s - 1e-9 < at / 1e9 <= robot.time_s for at in times)
        self.steps += 1
        self.words += len(times)
        robot.drive(0.01 * (self.words % 7), robot.odometry.left_m - robot.odometry.right_m + 0.2)
        robot.radio.send(Word(number=self.steps))
"""
# One group acts in every third tick only, and some of the other are dead for a while.
INSISTING = f"""
format = 1
name = "insisting"
duration_s = 3.0
arena = {{ size_m = [4.0, 4.0] }}

[robots]
often = {{ body = "epuck", count = 5, agent = "{PLAYERS}:Insisting" }}
seldom = {{ body = "epuck", count = 3, agent = "{PLAYERS}:Insisting", act_every_ticks = 3 }}

[radio]
preset = "ieee802154"
loss = 0.4
access = {{ method = "csma-802154", max_retries = 1 }}

[[events]]
at_s = 1.0
do = "kill"
robots = {{ group = "often", count = 2 }}
for_s = 0.5
"""
SEEKER = """
from swarmwire.agent import Agent

class Seeker(Agent):
    needs = ("light", "bumper", "positioning")

    def step(self, robot):
        x, y = robot.light.vector_sum()
        turn = 1.0 if robot.bumper.pressed else y - 0.1 * robot.positioning.x_m
        robot.drive(linear_mps=0.05 + 0.05 * x, angular_radps=turn)

class Stone(Agent):
    def step(self, robot): ...
"""
LIT = """
format = 1
name = "to the light"
duration_s = 3
[arena]
size_m = [3, 3]
lights = [{ intensity = 2.0, place = "random" }]
obstacles = [{ shape = "polygon", points = [[0, 0], [0.4, 0], [0, 0.4]], count = 3, place = "random" }]
[robots.moths]
body = "epuck-gps"
count = 10
agent = "seeker.py:Seeker"
[robots.stones]
body = "kilobot"
count = 2
agent = "seeker.py:Stone"
"""
RATES = {"scouts": 1, "every": 3, "carriers": "counting.py:Counting"}
VECTOR = [f"robots.{name}.agent={PLAYERS}:VectorInsisting" for name in ("often", "seldom")]
# Text or file of a scenario, and its overrides: what is hard to split among runners, and arenas.
DEMANDING: dict[str, tuple[str | Path, list[str]]] = {
    "every kind of event": (DISRUPTED, DISRUPTED_SHORT),
    "two rates": (MIXED.format(**RATES), ["duration_s=3"]),
    "slow groups": (MIXED.format(**RATES | {"scouts": 2, "every": 5}), ["duration_s=3"]),
    "agents that send again": (INSISTING, []),
    "senses of light, touch and place": (LIT, []),
}


def written(folder: Path, text: str) -> Path:
    """A scenario beside its agents."""
    (folder / "counting.py").write_text(COUNTING)
    (folder / "seeker.py").write_text(SEEKER)
    (folder / "scenario.toml").write_text(text)
    return folder / "scenario.toml"


@pytest.fixture(scope="module", params=DEMANDING.values(), ids=DEMANDING)
def demanding(request, tmp_path_factory) -> tuple[Path, list[str], Result]:
    """A scenario, its overrides, and its run in one process with two arenas."""
    source, overrides = request.param
    scenario = source if isinstance(source, Path) else written(tmp_path_factory.mktemp("demanding"), source)
    return scenario, overrides, run(scenario, seeds=[2, 1], overrides=overrides)


@pytest.mark.parametrize("runners", [1, 3, PER_ROBOT])
def test_demanding_scenarios_run_alike_in_every_layout(demanding, runners):
    """Per robot, runners are left with nobody alive, and get their robot back."""
    scenario, overrides, local = demanding
    spread = run_spread(scenario, runners, seeds=[2, 1], overrides=overrides)
    assert (spread.arenas, spread.events) == (local.arenas, local.events)


def test_arena_of_a_demanding_scenario_is_the_same_alone_and_among_others(demanding):
    scenario, overrides, local = demanding
    alone = run(scenario, seed=1, overrides=overrides)
    assert alone.arenas == local.arenas[1:]
    assert [event.robots[0] for event in alone.events] == [event.robots[1] for event in local.events]


def test_vector_agents_give_the_same_run_as_agents(tmp_path: Path):
    insisting = written(tmp_path, INSISTING)
    agents = run(insisting)
    for runners in (None, 2):
        vector = run_spread(insisting, runners, overrides=VECTOR)
        assert vector.trajectory_sha256 == agents.trajectory_sha256


def states(runners: int | None, seeds: Sequence[int]) -> list[list[str]]:
    """States that robots of a particle swarm note, (ticks, robots)."""
    watcher = Watcher()
    pso = ROOT / "scenarios" / "pso.toml"
    often = ["duration_s=4", "robots.particles.params.update_every_ticks=10"]
    run_spread(pso, runners, seeds=seeds, overrides=often, observers=[watcher])
    return [[truth.states[code] for code in truth.state] for truth in watcher.truths]


def test_states_are_the_same_in_every_layout_and_beside_other_arenas():
    alone = states(None, [2])
    assert states(3, [2]) == alone
    assert {"to its own best", "to the neighbours' best"} <= set(alone[-1])
    assert [tick[-10:] for tick in states(None, [5, 2])] == alone


SLOW = "robots.flock.act_every_ticks=4"


def radio_of(scenario, *overrides):
    radio = run(scenario, overrides=overrides).radio
    assert radio is not None
    return radio


def test_group_sends_as_often_as_it_acts(tmp_path):
    radio = radio_of(written(tmp_path, MIXED.format(**RATES)))
    assert radio.sent == 5 * 60 + 4 * 20
    assert sum(radio.fates.values()) == radio.intended == 8 * radio.sent


def test_packets_reach_a_slow_agent_at_the_tick_at_which_it_acts():
    every = ["duration_s=20", "radio.loss=0", "radio.jitter_s=0", "radio.send_offset='tick'", "radio.latency_s=0.05"]
    fast = radio_of(LOSSY, *every)
    slow = radio_of(LOSSY, *every, SLOW)
    assert fast.latency_agent_s.p50 == pytest.approx(0.1, rel=0.005)
    assert slow.latency_agent_s.p50 == pytest.approx(0.4, rel=0.005)
    assert slow.latency_air_s == fast.latency_air_s


def test_tx_status_reaches_every_robot_even_if_it_sends_to_itself(tmp_path: Path):
    """Or the tests above would say nothing: robots drive as fast as they were told of, and else stand."""
    with Simulation(written(tmp_path, INSISTING)) as simulation:
        last = [simulation.step() for _ in range(30)][-1]
    assert (last.command[:, 0] > 0.0).all()


@pytest.mark.parametrize(
    "radio",
    [
        "{ range_m = 2.0 }",
        "{ preset = 'ieee802154', access = { method = 'none' } }",
        "{ preset = 'ieee802154', access = { method = 'aloha' } }",
        "{ preset = 'ieee802154', access = { acknowledged = false } }",
        None,
    ],
)
def test_agent_needing_tx_status_is_refused_without_acknowledgements(tmp_path: Path, radio: str | None):
    path = tmp_path / "refused.toml"
    before, after = INSISTING.split("[radio]")
    path.write_text(f"{before}\n[[events]]{after.split('[[events]]')[1]}")
    with refused_input(path, "robots.often.agent", "'radio.tx_status'"):
        run(path, overrides=[f"radio={radio}"] if radio else [])
