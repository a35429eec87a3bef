"""Robots of a hall, followed by a tracker, under the radio of another run."""

from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from swarmwire.agent.on_robot.assembly import run_robot
from swarmwire.agent.on_robot.plan import robot_config
from swarmwire.agent.on_robot.safety import StopFlag
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy import Recording, Simulation, run
from swarmwire.deploy.runs.gateways import serving
from swarmwire.deploy.runs.gateways.gateways import Gateways
from tests.support.deploy.runs import ROOT
from tests.support.refusals import refused_input

HALL, AIR = (ROOT / "examples" / "motion" / f"{name}.toml" for name in ("hall", "air"))
BARE = Recording(tables=False, rrd=False)
RANGE_M = 0.6  # the robots begin 0.4 m apart, and drive apart at 0.12 m/s
SLACK_M = 0.05  # a fate becomes final up to a tick after its packet, and a delayed world lets robots drive on
FAR, MAX_TICKS = 10, 150  # packets out of range that are enough, and ticks until then
STANDING_TICKS = 5  # until both runs have the final poses


class Fates(Observer):
    """The distance of both robots, and the fates so far, at each tick."""

    def __init__(self) -> None:
        self.distance_m: list[float] = []
        self.received: list[int] = []
        self.out_of_range: list[int] = []

    def see(self, truth: Truth) -> None:
        self.distance_m.append(distance_m(truth.pose))
        self.received.append(int(truth.tally.fates[0, Fate.RECEIVED]))
        self.out_of_range.append(int(truth.tally.fates[0, Fate.OUT_OF_RANGE]))


def distance_m(pose: FloatArray) -> float:
    """The distance of two robots."""
    return float(np.hypot(*(pose[1] - pose[0])[:2]))


@contextmanager
def running(simulation: Simulation) -> Generator[None]:
    """Run the simulation in a thread within the context."""
    thread = Thread(target=simulation.run)
    thread.start()
    try:
        yield
    finally:
        simulation.controls.quit()
        thread.join()


def drive(settings: Path, address: str, end: StopFlag) -> None:
    """Run an agent by the settings of one run on the robot of another."""
    flags = {"driver.name": ("test", "epuck2"), "driver.address": ("test", address)}
    clock = WallClock()
    run_robot(robot_config(read_settings(settings, flags), str(settings), clock), clock, end, "driven")


def test_robots_of_a_hall_are_out_of_range_in_the_radio_of_another_run_once_they_have_driven_apart(tmp_path):
    fates, end = Fates(), StopFlag()
    hall = Simulation(HALL, gateways=Gateways({"": "epuck2"}, swarm="hall"), out=tmp_path / "hall", record=BARE)
    with hall, running(hall), ThreadPoolExecutor(2) as pool:
        overrides = [f"radio.range_m={RANGE_M}", f'robots.hall.motion.connect=["{hall.served.endpoints[0]}"]']
        options = {"out": tmp_path / "air", "record": BARE, "overrides": overrides, "observers": [fates]}
        with Simulation(AIR, gateways="radio-only", **options) as air:
            air.run(1)  # in the first tick robots are where the scenario places them
            files = [robot.file for robot in air.served.robots]
            addresses = [robot.address for robot in hall.served.robots]
            agents = [pool.submit(drive, *of_one, end) for of_one in zip(files, addresses, strict=True)]
            while sum(fates.out_of_range) < FAR and air.tick < MAX_TICKS:
                air.run(air.tick + 1)
            end.request("over")
            for agent in agents:
                agent.result()
            air.run(air.tick + STANDING_TICKS)
            assert distance_m(air.world.pose) == pytest.approx(distance_m(hall.world.pose), abs=1e-3)
    assert fates.distance_m[1] == pytest.approx(0.4)
    assert distance_m(hall.world.pose) > RANGE_M
    distances_m = np.array(fates.distance_m)
    near, far = distances_m < RANGE_M - SLACK_M, distances_m > RANGE_M + SLACK_M
    # For 0.2 m they need 1.67 s, in which two agents send 33 packets; a busy machine loses steps of agents.
    assert 15 < np.array(fates.received)[near].sum() < 50
    assert np.array(fates.out_of_range)[near].sum() == 0
    assert np.array(fates.received)[far].sum() == 0
    assert np.array(fates.out_of_range)[far].sum() > 0


def test_settings_of_robots_elsewhere_have_neither_a_driver_nor_the_limits_of_emulated_ones(
    scenario, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(serving, "GRACE_S", 0.01)  # wall time: from then on robots that no program drives are reported
    options = {"realtime": 100.0, "out": tmp_path / "run", "record": BARE}
    with Simulation(scenario, gateways={"other": "radio-only"}, **options) as simulation:
        robot = simulation.served.robots[0]
        simulation.run()
    assert "no program" not in capsys.readouterr().err
    assert not {"driver", "max_linear_mps", "max_angular_radps"} & set(robot.settings)
    assert robot.settings["radio"]["kind"] == "world"
    assert robot.command.endswith("robots/other-0.toml --driver NAME --address ADDRESS")
    with refused_input(match="driver"):
        read_settings(robot.file, {})


def test_robots_elsewhere_have_no_address_here(scenario):
    with refused_input(match="elsewhere"):
        run(scenario, gateways={"other": "radio-only@127.0.0.1:1000"}, realtime=100.0)
