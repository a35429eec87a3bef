"""Robots of a fleet that two agents would drive, and devices of a machine that two agents would use."""

import re
from collections.abc import Mapping, Sequence

from swarmwire.agent.drivers.driver import Driver
from swarmwire.deploy.fleet.fleet import Robot

OF_MACHINE = re.compile(r"(^|/)(127\.|localhost|\[::1\]|usb:)")  # a target that is another one on each machine


def clashes(robots: Sequence[Robot], drivers: Mapping[str, Driver]) -> list[tuple[str, str, str]]:
    """Of each robot with the target or the device of another: its name, the other's, and what was expected.

    Robots without a driver, by name, are passed over.
    """
    owners: dict[tuple[str, ...], str] = {}
    found: list[tuple[str, str, str]] = []
    for robot in robots:
        driver = drivers.get(robot.name)
        if driver is None:
            continue
        machine = robot.host.address, str(robot.host.port)
        target = robot.settings["driver"]["name"], driver.target
        needed = {("target", *target, *(machine if OF_MACHINE.search(driver.target) else ())): "another robot"}
        if driver.device:
            needed["device", driver.device, *machine] = f"another device than {driver.device} at {robot.host}"
        for key, what in needed.items():
            owner = owners.setdefault(key, robot.name)
            if owner != robot.name:
                found.append((robot.name, owner, f"expected {what}: {owner} has it; got {driver.address!r}"))
                break
    return found
