"""A rehearsal uses what a run uses, before anybody waits for it, and leaves the run as it is."""

from pathlib import Path

import numpy as np

from swarmwire.comms.packets import Fate
from swarmwire.deploy import Simulation, wiring
from swarmwire.deploy.gateways.serving import RunGateways
from swarmwire.deploy.scenario_parts import new_medium
from swarmwire.deploy.warm_up import warm_up
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.swarm.order import Speed
from swarmwire.world.scenario_file import load_scenario
from swarmwire.world.world import World

FLOCKING = Path(__file__).parents[3] / "scenarios" / "robots" / "flocking-epuck2.toml"


def test_in_a_rehearsal_robots_move_packets_are_received_and_metrics_are_measured(monkeypatch) -> None:
    scenario = load_scenario(FLOCKING)
    world = World(scenario, [1], {"flock": ("radio.range",)})
    fates, see = np.zeros(len(Fate), np.int64), Metrics.see

    def seen(self, truth) -> None:
        fates[:] += truth.tally.fates[0]
        see(self, truth)

    monkeypatch.setattr(Metrics, "see", seen)
    before = world.pose.copy()
    warm_up(world, new_medium(scenario, world, None), [Speed()])
    assert np.hypot(*(world.pose - before)[:, :2].T).min() > 0.0
    assert fates[Fate.RECEIVED] > 0


def test_a_run_with_gateways_is_rehearsed_before_one_of_them_answers(monkeypatch) -> None:
    said = list[str]()
    monkeypatch.setattr(wiring, "warm_up", lambda world, *_: said.append(f"rehearsed {world.static.robots}"))
    simulation = Simulation(FLOCKING, gateways="epuck2", realtime=100.0)
    served = RunGateways.served
    monkeypatch.setattr(RunGateways, "served", lambda *given: (said.append("served"), served(*given))[1])
    with simulation:
        assert simulation.world is not None
    assert said == ["rehearsed 8", "served"]


def test_every_run_in_real_time_is_rehearsed_and_goes_as_it_would_without(monkeypatch) -> None:
    rehearsed = list[int]()
    monkeypatch.setattr(wiring, "warm_up", lambda world, *rest: (rehearsed.append(1), warm_up(world, *rest)))
    results = list[list[str]]()
    for factor in (None, 1000.0):
        with Simulation(FLOCKING, realtime=factor) as simulation:
            simulation.run(5)
        results.append(simulation.result.trajectory_sha256)
    assert rehearsed == [1]
    assert results[0] == results[1]


def test_runs_that_keep_to_no_clock_are_not_rehearsed(monkeypatch) -> None:
    monkeypatch.setattr(wiring, "warm_up", None)
    with Simulation(FLOCKING) as simulation:
        simulation.run(1)
    assert simulation.result.ticks == 1
