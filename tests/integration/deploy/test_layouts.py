"""Law 2: the same scenario and seed give the same run bit for bit, in every layout, over real processes.

`tests/unit/deploy/test_layouts.py` runs every shipped scenario through the same frames in one process.
"""

import pytest

from swarmwire.comms.clock import WallClock
from swarmwire.deploy import Result, run
from swarmwire.deploy.runners import RunnerProcesses, local_endpoint, new_run_id
from swarmwire.deploy.scenario_parts import agent_specs, new_medium
from swarmwire.deploy.simulation import Simulation
from swarmwire.world.backends import allocation as assignments
from swarmwire.world.backends.zenoh_backend import LockstepBackend
from swarmwire.world.loop import Loop
from tests.support.deploy.commands import LOSSY, ROOT

SHORT = ["duration_s=3"]
SCENARIOS = sorted((ROOT / "scenarios").glob("*.toml"))


@pytest.fixture(scope="module")
def local() -> Result:
    return run(LOSSY, overrides=SHORT)


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda path: path.stem)
@pytest.mark.parametrize("runners", [3, "per-robot"])
def test_every_main_scenario_runs_alike_in_one_process_and_in_many(scenario, runners):
    one_second = ["duration_s=1"]
    alone = run(scenario, overrides=one_second).trajectory_sha256
    assert run(scenario, overrides=one_second, runners=runners).trajectory_sha256 == alone


def test_a_users_agent_of_the_same_rule_gives_the_same_run(local):
    mine = f"robots.flock.agent={ROOT / 'examples' / 'flocking_agent.py'}:MyFlocking"
    assert run(LOSSY, overrides=[*SHORT, mine], runners="per-robot").trajectory_sha256 == local.trajectory_sha256


def test_an_arena_is_the_same_alone_and_as_one_of_eight(local):
    eight = run(LOSSY, overrides=SHORT, seeds=range(1, 9), runners=3)
    assert eight.trajectory_sha256[0] == local.trajectory_sha256[0]
    assert eight.arenas[0].radio == local.radio
    assert eight.arenas[0].metrics == local.metrics


def test_which_runner_plays_which_robots_does_not_matter(local):
    """Runners get robots in the order in which they come: handing them out backwards is the other order of starting."""
    simulation = Simulation(LOSSY, overrides=SHORT)
    specs = agent_specs(simulation.scenario)
    parts = assignments.split(assignments.whole(simulation.scenario, simulation.world.static, specs), 3)
    run_id = new_run_id()
    with local_endpoint(None) as endpoint:
        backend = LockstepBackend(endpoint, run_id, parts[::-1], 30.0, WallClock())
        backend.open()
        processes = RunnerProcesses(endpoint, run_id, sorted(specs.values()), ["c", "b", "a"])
        try:
            backend.start()
            loop = Loop(simulation.world, new_medium(simulation.scenario, simulation.world, traces=None), backend, [])
            loop.run(simulation.ticks)
        finally:
            backend.close()
            processes.stop()
    assert loop.hexdigests() == local.trajectory_sha256
