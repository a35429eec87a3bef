"""The gateways of a run: which robots answer as real ones, at which addresses, and the settings of their agents.

`choose_gateways` checks them against the scenario; `GatewayRobotSettings` makes the settings of `swarmwire-agent`.
"""

import socket
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from swarmwire.agent.drivers.driver import load_driver
from swarmwire.comms.base.atomic import make_subfolder, write_text
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.tables import parse_table
from swarmwire.comms.wire.assignment import params_of
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.robots.certificates.register import revoked_in
from swarmwire.world.gateways.gateway import Gateway, gateway_kind
from swarmwire.world.scenario.bodies import sheet_path
from swarmwire.world.scenario.scenario import Scenario

OTHER_GROUPS = ""  # key of the gateway of all groups without an entry
LOOPBACK = Network(listen=("tcp/127.0.0.1:0",))
FIELD, OPTIONS_FIELD, SWARM_FIELD, NETWORK_FIELD = "gateways", "gateways.options", "gateways.swarm", "gateways.network"


@dataclass(frozen=True)
class Gateways:
    """Gateways of a run, and the network on which it publishes poses and its radio medium serves agents of such robots.

    `kinds` has "KIND" or "KIND@ADDRESS" for each group, and for all others under ""; without an address the gateway
    chooses one.
    """

    kinds: Mapping[str, str]
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])  #: keys: "option" for all, or "group.option"
    swarm: str = "swarm"  #: the root of the network's keys
    network: Network = LOOPBACK  #: the run's endpoints; the default is a free port of this machine


GatewayOption = Gateways | Mapping[str, str] | str | None


def as_gateways(gateways: GatewayOption) -> Gateways | None:
    """Return gateways from any form of the option: `Gateways`, a mapping by group, or one text for all groups.

    The names in the register of certificates beside the CA's are revoked, too; BadInput if it cannot be read.
    """
    if gateways is None:
        return None
    if not isinstance(gateways, Gateways):
        gateways = Gateways({OTHER_GROUPS: gateways} if isinstance(gateways, str) else gateways)
    network = gateways.network
    more = [name for name in revoked_in(network.ca.parent) if name not in network.revoked] if network.ca else []
    return replace(gateways, network=replace(network, revoked=(*network.revoked, *more))) if more else gateways


@dataclass(frozen=True)
class GatewayChoice:
    """The gateway of one group, not yet opened."""

    kind: str
    address: str  # "": the gateway chooses it
    gateway_class: type[Gateway]
    options: Any  # an instance of `gateway_class.options`

    def sensors(self, body: Body) -> tuple[str, ...]:
        """Return the sensors of this body that the gateway serves."""
        return tuple(name for name in body.sensors if name in self.gateway_class.sensors)


def choose_gateways(gateways: Gateways, scenario: Scenario) -> dict[str, GatewayChoice]:
    """Return the gateway of each group; BadInput for an unknown group, kind or option, or an invalid value."""
    for group, text in gateways.kinds.items():
        if group != OTHER_GROUPS and group not in scenario.robots:
            expected = f"expected a group of the scenario, {did_you_mean(scenario.robots, group)}; got {group!r}"
            raise BadInput(FIELD, f"{group}={text}", expected)
    fault = fault_of_name(gateways.swarm)
    if fault:
        raise BadInput(SWARM_FIELD, "", fault)
    texts = {group: gateways.kinds.get(group, gateways.kinds.get(OTHER_GROUPS)) for group in scenario.robots}
    kinds = {group: text.partition("@") for group, text in texts.items() if text is not None}
    classes = {group: gateway_kind(kind, FIELD, texts[group] or "") for group, (kind, _, _) in kinds.items()}
    options = _options_by_group(gateways.options, classes)
    return {
        group: GatewayChoice(
            kind,
            address,
            classes[group],
            parse_table(classes[group].options, options[group], OPTIONS_FIELD, ""),
        )
        for group, (kind, _, address) in kinds.items()
    }


def _options_by_group(options: Mapping[str, Any], classes: Mapping[str, type[Gateway]]) -> dict[str, dict[str, Any]]:
    """Return the options of each group's gateway; an option of a group overrides the one of all groups."""
    names = {group: {option.name for option in fields(kind.options)} for group, kind in classes.items()}
    by_group: dict[str, dict[str, Any]] = {group: {} for group in classes}
    for key in sorted(options, key=lambda key: "." in key):
        group, _, option = key.rpartition(".")
        if group and group not in classes:
            expected = f"expected a group that has a gateway, {did_you_mean(classes, group)}; got {group!r}"
            raise BadInput(OPTIONS_FIELD, key, expected)
        candidates = [group] if group else list(classes)
        matches = [candidate for candidate in candidates if option in names[candidate]]
        if not matches:
            possible = sorted(set[str]().union(*(names[candidate] for candidate in candidates)))
            expected = (
                f"unknown option; expected {did_you_mean(possible, option)}"
                if possible
                else "expected none: it has no options"
            )
            raise BadInput(OPTIONS_FIELD, key, expected)
        for match in matches:
            by_group[match][option] = options[key]
    return by_group


ROBOTS = "robots"  # folder of robots' settings in the run folder
WATCHDOG_STEPS, MAX_WATCHDOG_S = 2, 10.0  # bounds of a robot's watchdog: at least these steps, at most this time


@dataclass(frozen=True)
class GatewayRobotSettings:
    """Makes the settings with which robots behind gateways act as they would in the run.

    Limits of emulated robots are the body's, since these cannot hurt people.
    """

    scenario: Scenario
    static: Static
    agents: Mapping[str, str]  # spec of each group's agent
    swarm: str
    network: Network  # network of the run
    endpoints: tuple[str, ...]  # endpoints of the run
    pace: float  # simulated s per s of wall time
    listen: Mapping[str, str]  # endpoint at which each robot waits for the robots after it, in order

    def robot_table(self, row: int, choice: GatewayChoice, address: str) -> dict[str, Any]:
        """Return the content of `robot.toml` for the robot of this row, which answers at `address`.

        A robot elsewhere, without an address, has neither a driver nor limits in it.
        """
        group = next(group for group in self.static.groups if group.start <= row < group.stop)
        names, table, drive = self.static.robot_names, self.scenario.robots[group.name], group.body.drive
        if table.body_overrides:
            expected = "expected none: robots read their body's sheet from a file, which `body` may name"
            raise BadInput(self.scenario.source, f"robots.{group.name}.body_overrides", expected)
        sheet, radio = sheet_path(table.body, self.scenario.source), self.scenario.radio
        rate_hz = max(1, round(self.static.rate_hz / group.act_every_ticks))
        emulated = {
            "max_linear_mps": drive.max_linear_mps,
            "max_angular_radps": drive.max_angular_radps,
            "driver": {"name": choice.kind, "address": address, **_shared_options(choice)},
        }
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
            **(emulated if address else {}),
            "radio": {"kind": "world", "max_payload_bytes": radio.max_payload_bytes} if radio else {"kind": "none"},
            "tracker": True,
            "network": self._network_table(names[row]),
            "pace": self.pace,
            "seed": self.static.seeds[0],
        }

    def _network_table(self, name: str) -> dict[str, Any]:
        """Return the endpoints and certificates of a robot; its certificate lies beside its settings."""
        run = [endpoint.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:") for endpoint in self.endpoints]
        table: dict[str, Any] = {"connect": run}
        if name in self.listen:  # robots' own radios forward nothing, so each pair has a link, which one of them opens
            names = list(self.listen)
            earlier = names[: names.index(name)]
            table = {"listen": [self.listen[name]], "connect": [*run, *(self.listen[robot] for robot in earlier)]}
        if self.network.proves:
            ca = Path(self.network.ca or "").absolute()
            table |= {"ca": str(ca), "certificate": f"{name}.pem", "key": f"{name}.key"}
        if self.network.revoked:
            table["revoked"] = list(self.network.revoked)
        return table | ({"insecure": True} if self.network.insecure else {})


def write_settings(folder: Path, settings: Mapping[str, Any]) -> Path:
    """Write a robot's settings into the run folder; return their path."""
    path = folder / ROBOTS / f"{settings['name']}.toml"
    make_subfolder(path.parent)
    write_text(path, tomli_w.dumps(settings))
    return path


def _shared_options(choice: GatewayChoice) -> dict[str, Any]:
    """Return the options that driver and gateway have in common, where they differ from the driver's defaults."""
    try:
        driver = load_driver(choice.kind, "", "")
    except BadInput:  # a gateway for foreign programs alone
        return {}
    defaults = {option.name: option.default for option in fields(driver.options)}
    shared = [option.name for option in fields(choice.gateway_class.options) if option.name in defaults]
    values = {name: getattr(choice.options, name) for name in shared}
    return {name: value for name, value in values.items() if value is not None and value != defaults[name]}


def free_endpoints(names: Sequence[str], network: Network) -> dict[str, str]:
    """Return an endpoint on loopback for each robot, with different ports that are free now.

    With certificates there are none, since these are issued for addresses.
    """
    if network.proves:
        return {}
    with ExitStack() as stack:
        servers = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in names]
        ports = [server.getsockname()[1] for server in servers]
        return {name: f"tcp/127.0.0.1:{port}" for name, port in zip(names, ports, strict=True)}
