"""What `swarmwire-agent` needs to drive robots of a run: the settings of each, and their files in the run folder."""

import socket
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from swarmwire.agent.drivers.driver import load_driver
from swarmwire.comms.assignment import params_of
from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import Static
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.gateways.gateways import Chosen
from swarmwire.metrics.atomic import write_text
from swarmwire.world.scenario.bodies import sheet_path
from swarmwire.world.scenario.scenario import Scenario

ROBOTS = "robots"  # within the run folder
WATCHDOG_STEPS, MAX_WATCHDOG_S = 2, 10.0  # what a robot takes: more than a step, and no more than this


@dataclass(frozen=True)
class RobotSettings:
    """From a run to the settings of its robots, with which they act as they would in it.

    Their limits are the body's own, since emulated robots run into nobody.
    """

    scenario: Scenario
    static: Static
    agents: Mapping[str, str]  # by group: the agent's spec
    swarm: str
    network: Network  # the run's
    endpoints: tuple[str, ...]  # of it
    pace: float
    listens: Mapping[str, str]  # by robot, in order: where it waits for those after it

    def of(self, row: int, chosen: Chosen, address: str) -> dict[str, Any]:
        """The content of `robot.toml` for the robot of this row, which answers at `address`."""
        group = next(group for group in self.static.groups if group.start <= row < group.stop)
        names, table, drive = self.static.robot_names, self.scenario.robots[group.name], group.body.drive
        if table.body_overrides:
            expected = "expected none: robots read their body's sheet from a file, which `body` may name"
            raise BadInput(self.scenario.source, f"robots.{group.name}.body_overrides", expected)
        sheet, medium = sheet_path(table.body, self.scenario.source), self.scenario.radio
        rate_hz = max(1, round(self.static.rate_hz / group.act_every_ticks))
        return {
            "format": 1,
            "name": names[row],
            "swarm": self.swarm,
            "robots": list(names),
            "agent": self.agents[group.name],
            "params": params_of(table.params, np.array([row - group.start])),
            "body": str(sheet) if sheet else table.body,
            "rate_hz": rate_hz,
            "watchdog_s": min(max(self.scenario.run.watchdog_s, WATCHDOG_STEPS / rate_hz), MAX_WATCHDOG_S),
            "max_linear_mps": drive.max_linear_mps,
            "max_angular_radps": drive.max_angular_radps,
            "driver": {"name": chosen.kind, "address": address, **_shared_options(chosen)},
            "radio": {"kind": "world", "max_payload_bytes": medium.max_payload_bytes} if medium else {"kind": "none"},
            "tracker": True,
            "network": self._network(names[row]),
            "pace": self.pace,
            "seed": self.static.seeds[0],
        }

    def _network(self, name: str) -> dict[str, Any]:
        """How the robot reaches the run; its own certificate is looked for beside its settings."""
        reached = [at.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:") for at in self.endpoints]
        found: dict[str, Any] = {"connect": reached}
        if name in self.listens:  # radios of their own pass nothing on: each two are linked, by one of them
            before = list(self.listens)[: list(self.listens).index(name)]
            found = {"listen": [self.listens[name]], "connect": [*reached, *(self.listens[of] for of in before)]}
        if self.network.proves:
            ca = Path(self.network.ca or "").absolute()
            found |= {"ca": str(ca), "certificate": f"{name}.pem", "key": f"{name}.key"}
        if self.network.revoked:
            found["revoked"] = list(self.network.revoked)
        return found | ({"insecure": True} if self.network.insecure else {})


def write_settings(folder: Path, settings: Mapping[str, Any]) -> Path:
    """Write a robot's settings into the run folder; where they are."""
    path = folder / ROBOTS / f"{settings['name']}.toml"
    path.parent.mkdir(exist_ok=True)
    write_text(path, tomli_w.dumps(settings))
    return path


def _shared_options(chosen: Chosen) -> dict[str, Any]:
    """Options that driver and gateway both have, such as how they are to meet, where they differ from the driver's."""
    try:
        driver = load_driver(chosen.kind, "", "")
    except BadInput:  # a gateway for foreign programs alone
        return {}
    known = {of.name: of.default for of in fields(driver.options)}
    given = {of.name: getattr(chosen.options, of.name) for of in fields(chosen.made.options) if of.name in known}
    return {name: value for name, value in given.items() if value is not None and value != known[name]}


def listening_places(names: Sequence[str], network: Network) -> dict[str, str]:
    """By robot, in their order: an endpoint on loopback with a port that is free now, and no other's.

    With certificates there are none: those are made out to addresses, which their owner knows.
    """
    if network.proves:
        return {}
    with ExitStack() as stack:
        held = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in names]
        return {name: f"tcp/127.0.0.1:{one.getsockname()[1]}" for name, one in zip(names, held, strict=True)}
