"""Runs whose robots are driven by their agents from outside: as on robots, in threads of this process."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from swarmwire.agent.drivers.driver import Driver
from swarmwire.agent.on_robot.assembly import run_robot
from swarmwire.agent.on_robot.plan import robot_config
from swarmwire.agent.on_robot.safety import StopFlag
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.clock import ScaledClock, WallClock
from swarmwire.comms.interfaces import Observer
from swarmwire.deploy import Recording, Result, Simulation
from swarmwire.deploy.gateways.gateways import GatewaysGiven

BARE = Recording(tables=False, rrd=False)


class DrivenRobots:
    """The agents of all robots that a run serves; the first fault of one is raised at the end."""

    def __init__(self, simulation: Simulation, radio: str | None, broken: bool) -> None:
        assert simulation.served is not None
        self._end, self._broken = StopFlag(), broken
        chosen = {} if radio is None else {"radio.kind": radio}
        self._robots = {robot.file: chosen for robot in simulation.served.robots if robot.file}
        self._together = threading.Barrier(len(self._robots) + 1, timeout=20.0)
        self._pool = ThreadPoolExecutor(len(self._robots))
        self._agents: list[Future[None]] = []

    def __enter__(self) -> "DrivenRobots":
        self._agents = [self._pool.submit(self._drive, file, flags) for file, flags in self._robots.items()]
        for agent in self._agents:
            agent.add_done_callback(lambda _: self._together.abort())  # whoever is done before all begin, failed
        self._meet()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.ask("over")
        self._pool.shutdown()
        for agent in self._agents:
            agent.result()

    def _drive(self, file: Path, given: dict[str, Any]) -> None:
        settings = read_settings(file, {key: ("test", value) for key, value in given.items()})
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
    gateways: GatewaysGiven,
    folder: Path,
    *,
    pace: float,
    overrides: tuple[str, ...] = (),
    radio: str | None = None,
    broken: bool = False,
    observers: Sequence[Observer] = (),
) -> Result:
    """The result of a run whose robots stand behind gateways, driven through their protocol.

    `radio` is that of the robots, if it is not the medium of the run.
    """
    simulation = Simulation(
        scenario, gateways=gateways, realtime=pace, overrides=overrides, observers=observers, out=folder, record=BARE
    )
    with simulation, DrivenRobots(simulation, radio, broken):
        simulation.run()
    return simulation.result
