"""The choice of gateways: which robots of a run answer as real ones, from Python or options of `swarmwire run`.

`chosen_gateways` checks the choice against the scenario; `GatewayRobotSettings` are what `swarmwire-agent` needs to
drive such robots.
"""

import socket
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from swarmwire.agent.drivers.driver import load_driver
from swarmwire.comms.base.atomic import make_subfolder, write_text
from swarmwire.comms.base.config import did_you_mean, from_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.tables import parse_table
from swarmwire.comms.wire.access_control import TRACKER
from swarmwire.comms.wire.assignment import params_of
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.comms.wire.network import Network, as_options
from swarmwire.deploy.robots.certificates.member import member
from swarmwire.deploy.robots.certificates.register import revoked_in
from swarmwire.world.gateways.gateway import Gateway, gateway_kind
from swarmwire.world.scenario.bodies import sheet_path
from swarmwire.world.scenario.scenario import Scenario

OTHERS = ""  # in place of a group: all that are not named
LOOPBACK = Network(listen=("tcp/127.0.0.1:0",))
WHERE, OPTION, SWARM = "--gateway", "--gateway-set", "--swarm"


@dataclass(frozen=True)
class Gateways:
    """Gateways of a run, and the network on which it publishes poses and its radio medium serves agents of such robots.

    `of` has "KIND" or "KIND@ADDRESS" for each group, and for all others under ""; without an address the gateway
    chooses one.
    """

    of: Mapping[str, str]
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])  # by "option", of all, or "group.option"
    swarm: str = "swarm"  # the root of the network's keys
    network: Network = LOOPBACK  # where the run listens; in the default on a free port of this machine alone


GatewaysGiven = Gateways | Mapping[str, str] | str | None


def as_gateways(given: GatewaysGiven) -> Gateways | None:
    """What was given in one of the forms that `run` takes: whole, by group, or one text for all groups.

    Revoked are also the names in the register of certificates beside the CA's, if it is there; BadInput if that cannot
    be read.
    """
    if given is None:
        return None
    gateways = given if isinstance(given, Gateways) else Gateways({OTHERS: given} if isinstance(given, str) else given)
    network = gateways.network
    more = [name for name in revoked_in(network.ca.parent) if name not in network.revoked] if network.ca else []
    return replace(gateways, network=replace(network, revoked=(*network.revoked, *more))) if more else gateways


def gateways_of_options(
    gateways: Sequence[str], options: Sequence[str], swarm: str | None, network: Network | None
) -> Gateways | None:
    """From `--gateway [GROUP=]KIND[@ADDRESS]`, `--gateway-set [GROUP.]OPTION=VALUE` and so on; None: there are none.

    BadInput for texts of another form, and for options without a gateway.
    """
    of: dict[str, str] = {}
    for text in gateways:
        before, at, address = text.partition("@")
        group, equals, kind = before.rpartition("=")
        if not kind or (equals and not group) or (at and not address):
            expected = "expected KIND, KIND@ADDRESS, GROUP=KIND or GROUP=KIND@ADDRESS"
            raise BadInput("--gateway", text, expected)
        if group in of:
            named = f"the group {group!r}" if group else "all groups"
            raise BadInput("--gateway", text, f"expected one gateway for {named}, got a second one")
        of[group] = f"{kind}{at}{address}"
    if of:
        made = Gateways(of, dict(_option(text) for text in options))
        made = made if swarm is None else replace(made, swarm=swarm)
        return made if network is None else replace(made, network=network)
    flag_of_network = "--network"
    if network is not None and (network.proves or network.insecure):
        flag_of_network = "--certs" if network.proves else "--insecure"
    for flag, given in (("--gateway-set", bool(options)), ("--swarm", swarm), (flag_of_network, network)):
        if given:
            raise BadInput(flag, "", "expected --gateway with it: no robot of this run answers as a real one")
    return None


def network_of(
    endpoint: str | None, certs: Path | None, revoked: Sequence[str] = (), *, insecure: bool
) -> Network | None:
    """From `--network` and what goes with it; None where nothing is said of it. BadInput if it will not do.

    The run is the tracker of its robots' network, and has its name.
    """
    name = None if certs is None else TRACKER
    given = member(TRACKER, certs=certs, name=name, revoked=revoked, insecure=insecure).network
    if endpoint is None and given == Network():
        return None
    network = replace(given, listen=LOOPBACK.listen if endpoint is None else (endpoint,))
    try:
        network.check("")
    except BadInput as error:
        raise BadInput("--network", "", as_options(error.expected)) from None
    return network


def _option(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise BadInput("--gateway-set", text, "expected OPTION=VALUE or GROUP.OPTION=VALUE")
    try:
        found = from_toml(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return name.strip(), value.strip()
    return name.strip(), found["value"] if len(found) == 1 else value


@dataclass(frozen=True)
class GatewayChoice:
    """The gateway of one group, not made yet."""

    kind: str
    address: str  # "": of the gateway's choice
    made: type[Gateway]
    options: Any  # an instance of `made.options`

    def sensors(self, body: Body) -> tuple[str, ...]:
        """The sensors of this body that it serves."""
        return tuple(name for name in body.sensors if name in self.made.sensors)


def chosen_gateways(gateways: Gateways, scenario: Scenario) -> dict[str, GatewayChoice]:
    """By group: its gateway; BadInput for a group, kind or option that is not there, or a value that will not do."""
    for group in gateways.of:
        if group != OTHERS and group not in scenario.robots:
            expected = f"expected a group of the scenario, {did_you_mean(scenario.robots, group)}; got {group!r}"
            raise BadInput(WHERE, f"{group}={gateways.of[group]}", expected)
    fault = fault_of_name(gateways.swarm)
    if fault:
        raise BadInput(SWARM, "", fault)
    texts = {group: gateways.of.get(group, gateways.of.get(OTHERS)) for group in scenario.robots}
    kinds = {group: text.partition("@") for group, text in texts.items() if text is not None}
    made = {group: gateway_kind(kind, WHERE, texts[group] or "") for group, (kind, _, _) in kinds.items()}
    options = _options(gateways.options, made)
    return {
        group: GatewayChoice(kind, address, made[group], parse_table(made[group].options, options[group], OPTION, ""))
        for group, (kind, _, address) in kinds.items()
    }


def _options(given: Mapping[str, Any], made: Mapping[str, type[Gateway]]) -> dict[str, dict[str, Any]]:
    """By group what was given for its gateway; what names a group counts more than what is for all."""
    known = {group: {of.name for of in fields(kind.options)} for group, kind in made.items()}
    found: dict[str, dict[str, Any]] = {group: {} for group in made}
    for name in sorted(given, key=lambda name: "." in name):
        group, _, option = name.rpartition(".")
        if group and group not in made:
            expected = f"expected a group that has a gateway, {did_you_mean(made, group)}; got {group!r}"
            raise BadInput(OPTION, name, expected)
        takers = [of for of in ([group] if group else made) if option in known[of]]
        if not takers:
            options = sorted(set[str]().union(*(known[of] for of in ([group] if group else made))))
            expected = (
                f"unknown option; expected {did_you_mean(options, option)}"
                if options
                else "expected none: it has no options"
            )
            raise BadInput(OPTION, name, expected)
        for of in takers:
            found[of][option] = given[name]
    return found


ROBOTS = "robots"  # within the run folder
WATCHDOG_STEPS, MAX_WATCHDOG_S = 2, 10.0  # what a robot takes: more than a step, and no more than this


@dataclass(frozen=True)
class GatewayRobotSettings:
    """From a run to the settings of its robots, with which they act as they would in it.

    Their limits are the body's own, since emulated robots cannot hurt people.
    """

    scenario: Scenario
    static: Static
    agents: Mapping[str, str]  # by group: the agent's spec
    swarm: str
    network: Network  # the run's
    endpoints: tuple[str, ...]  # of it
    pace: float
    listens: Mapping[str, str]  # by robot, in order: where it waits for those after it

    def robot_table(self, row: int, chosen: GatewayChoice, address: str) -> dict[str, Any]:
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
    make_subfolder(path.parent)
    write_text(path, tomli_w.dumps(settings))
    return path


def _shared_options(chosen: GatewayChoice) -> dict[str, Any]:
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
