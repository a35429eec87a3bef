"""Runs whose robots are driven through gateways."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.agent.drivers.driver import Driver
from swarmwire.agent.on_robot.assembly import run_robot
from swarmwire.agent.on_robot.plan import robot_config
from swarmwire.agent.on_robot.safety import StopFlag
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.base import plugins
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import ScaledClock, WallClock
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.deploy import ArenaResult, Recording, Result, Simulation
from swarmwire.deploy.runs.gateways.gateways import GatewayOption
from swarmwire.world.gateways import gateway
from tests.support.world.gateways import ScriptedGateway

BARE = Recording(tables=False, rrd=False)
TWO_GROUPS = """
format = 1
name = "two groups"
duration_s = 2.0

[arena]
size_m = [2.0, 2.0]

[robots.own]
body = "epuck2"
count = 2
agent = "swarmwire.agent.behaviours:Avoidance"

[robots.other]
body = "epuck2"
count = 3
agent = "swarmwire.agent.behaviours:Flocking"

[radio]
range_m = 1.5
measures = { range = {}, bearing = {} }
"""
COUNTS = ("collisions", "wall_contacts")
FINAL = ("order", "target_best", "target_mean", *COUNTS)
METRICS = {"mean order": "mean", "min_gap": "mean", **dict.fromkeys(FINAL, "final")}  # by the value that counts


class DrivenRobots:
    """The agents of all robots that a run serves; the first fault of one is raised at the end."""

    def __init__(self, simulation: Simulation, radio: str | None, broken: bool, together: bool = True) -> None:
        """`together`: the run waits until all are connected, which a Crazyflie, whose logs come at ticks, never is."""
        self._end, self._broken = StopFlag(), broken
        chosen = {} if radio is None else {"radio.kind": radio}
        self._robots = {robot.file: chosen for robot in simulation.served.robots if robot.file}
        self._together = threading.Barrier(len(self._robots) + 1 if together else 1, timeout=20.0)
        self._pool = ThreadPoolExecutor(len(self._robots))
        self._agents: list[Future[None]] = []

    def __enter__(self) -> "DrivenRobots":
        self._agents = [self._pool.submit(self._drive, file, flags) for file, flags in self._robots.items()]
        for agent in self._agents:
            agent.add_done_callback(lambda _: self._together.abort())  # whoever is done before all begin, failed
        self._meet()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.request("over")
        self._pool.shutdown()
        for agent in self._agents:
            agent.result()

    def _drive(self, file: Path, values: dict[str, Any]) -> None:
        settings = read_settings(file, {key: ("test", value) for key, value in values.items()})
        clock = ScaledClock(WallClock(), settings.pace)
        plan = robot_config(settings, str(file), clock)
        driver = plan.driver
        driver.open = partial(self._open, driver, driver.open)
        if self._broken:
            turn_the_wrong_way(driver)
        run_robot(plan, clock, self._end, "driven")

    def _open(self, driver: Driver, open_driver: Callable[[], None]) -> None:
        """Open it, and wait until the agents of all robots are about to begin, and the world is."""
        open_driver()
        driver.open = open_driver
        self._meet()

    def _meet(self) -> None:
        with suppress(threading.BrokenBarrierError):  # the fault of one is raised at the end
            self._together.wait()


def turn_the_wrong_way(driver: Driver) -> None:
    """A fault that a test must see."""
    act = driver.act
    driver.act = lambda command: act(replace(command, angular_radps=-command.angular_radps))


def driven(
    scenario: Path,
    gateways: GatewayOption,
    folder: Path,
    *,
    pace: float,
    overrides: tuple[str, ...] = (),
    radio: str | None = None,
    broken: bool = False,
    observers: Sequence[Observer] = (),
    together: bool = True,
    record: Recording = BARE,
) -> Result:
    """The result of a run whose robots stand behind gateways, driven through their protocol.

    `radio` is that of the robots, if it is not the medium of the run.
    """
    simulation = Simulation(
        scenario, gateways=gateways, realtime=pace, overrides=overrides, observers=observers, out=folder, record=record
    )
    with simulation, DrivenRobots(simulation, radio, broken, together):
        simulation.run()
    return simulation.result


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A scenario of two groups, `own` and `other`."""
    path = tmp_path / "two.toml"
    path.write_text(TWO_GROUPS)
    return path


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> list[ScriptedGateway]:
    """The gateways of kind "scripted" that runs of this test make, in order."""
    point = EntryPoint("scripted", "tests.support.world.gateways:ScriptedGateway", gateway.GROUP)
    monkeypatch.setattr(plugins, "entry_points_of", lambda _: [point])
    instances: list[ScriptedGateway] = []
    monkeypatch.setattr(ScriptedGateway, "instances", instances)
    return instances


class Speeds(Observer):
    """Observer that knows how fast robots were on average, and how fast they turned."""

    def begin(self, static: Static) -> None:
        self.static, self.ticks = static, 0
        self.moved = np.zeros((2, static.arenas))

    def see(self, truth: Truth) -> None:
        velocity = truth.velocity.reshape(self.static.arenas, -1, 3)
        self.moved += np.stack([np.hypot(velocity[..., 0], velocity[..., 1]).mean(1), np.abs(velocity[..., 2]).mean(1)])
        self.ticks += 1

    def means(self, arena: int) -> dict[str, float]:
        """Mean speed in m/s and mean turn rate in rad/s of the robots of an arena."""
        speed, turn = self.moved[:, arena] / self.ticks
        return {"speed": float(speed), "turn": float(turn)}


def measured(arena: ArenaResult, speeds: dict[str, float]) -> dict[str, float]:
    """All numbers that the run has."""
    numbers = dict(speeds)
    for name, which in METRICS.items():
        value = getattr(arena.metrics[name.removeprefix("mean ")], which)
        if value is not None:
            numbers[name] = value
    return numbers


def outside(numbers: dict[str, float], spread: dict[str, FloatArray], names: tuple[str, ...]) -> list[str]:
    """Which of these numbers lie outside the range of `spread`, told.

    The range is widened on either side by its width, or by a tenth of its highest value, if that is more.

    If a number is drawn as those of the spread are, one of twenty seeds, it lies outside of their range with a
    probability of 2 in 21, and outside of the widened one with one of 2e-3 if it is normal. Counts may be two more.
    """
    lines: list[str] = []
    for name in names:
        low, high = float(spread[name].min()), float(spread[name].max())
        more = high - low + 2.0 if name in COUNTS else max(high - low, 0.1 * high)
        if not low - more <= numbers[name] <= high + more:
            expected = f"{low:.4g} to {high:.4g}, and {more:.4g} beyond at most"
            lines.append(f"{name} is {numbers[name]:.4g}, expected {expected}")
    return lines
