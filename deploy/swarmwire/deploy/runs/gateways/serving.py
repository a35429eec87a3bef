"""Robots of a run that answer as real ones during the run."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote
from typing import Any

from swarmwire.comms.base.clock import DatedClock, ScaledClock, to_s
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.phy.polling import new_polling
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.wire.access_control import access_of
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.deploy.machine import command_path
from swarmwire.deploy.runs.gateways.gateways import (
    NETWORK_FIELD,
    GatewayChoice,
    GatewayRobotSettings,
    Gateways,
    choose_gateways,
    free_endpoints,
    write_settings,
)
from swarmwire.metrics.text import abbreviate
from swarmwire.world.gateways.backend import GatewayGroup
from swarmwire.world.gateways.crazyflie.gateway import CrazyflieGateway
from swarmwire.world.gateways.crazyflie.radio import CrazyradioPorts
from swarmwire.world.gateways.gateway import Gateway
from swarmwire.world.gateways.radio_bridge import BridgedRadio, EmulatedTracker, RadioBridge
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.world import World


@dataclass(frozen=True)
class ServedRobot:
    """A robot of a run that answers as a real one."""

    name: str
    kind: str  # kind of its gateway, and of the driver that connects to it
    address: str  # address in the driver's format; "": the robot is elsewhere
    settings: Mapping[str, Any]  # settings of `swarmwire-agent`, the content of `robot.toml`
    file: Path | None  # file of the settings, with a run folder

    @property
    def command(self) -> str | None:
        """The shell command that drives the robot; None without a run folder."""
        if self.file is None:
            return None
        command = f"{quote(str(command_path('swarmwire-agent')))} run --config {quote(str(self.file))}"
        return command if self.address else f"{command} --driver NAME --address ADDRESS"


@dataclass(frozen=True)
class Served:
    """All served robots of a run, ready to answer."""

    groups: tuple[GatewayGroup, ...]
    robots: tuple[ServedRobot, ...]
    medium: RadioBridge | None
    show: Callable[[], None]  #: publishes the poses of all robots
    show_counts: Callable[[], dict[str, int]]  #: counts of poses that were not published
    swarm: str
    endpoints: tuple[str, ...]  #: endpoints of the robots' network
    crazyradio: CrazyradioPorts | None  #: the radio of Crazyflies

    def robot_addresses(self) -> dict[int, tuple[str, str]]:
        """Return the gateway's address by index of the robots here: on one with a network of its own, and outside."""
        gateways = ((row, group.gateway) for group in self.groups for row in group.rows.tolist())
        return {
            row: (gateway.on_robot(robot.address), robot.address)
            for (row, gateway), robot in zip(gateways, self.robots, strict=True)
            if robot.address
        }


class RunGateways:
    """The gateways of one run.

    Attributes:
        kinds: the kind of each group's gateway.
    """

    def __init__(self, gateways: Gateways, scenario: Scenario) -> None:
        """Check the gateways; BadInput for an unknown group, kind or option."""
        self._gateways, self._scenario = gateways, scenario
        gateways.network.check(NETWORK_FIELD)
        self._choices: Mapping[str, GatewayChoice] = choose_gateways(gateways, scenario)
        self.kinds = {group: choice.kind for group, choice in self._choices.items()}

    @property
    def has_crazyradio(self) -> bool:
        """True if packets of Crazyflies' clients cross the scenario's radio."""
        radio, kinds = self._scenario.radio, (choice.gateway_class for choice in self._choices.values())
        is_esb = radio is not None and radio.access_or_default.method == "esb"
        return is_esb and any(issubclass(kind, CrazyflieGateway) for kind in kinds)

    def with_safelink(self) -> Scenario:
        """Return the scenario with Safelink on its radio, as cflib switches it on; BadInput if a station is a drone."""
        scenario, radio, names = self._scenario, self._scenario.radio, self._scenario.robot_names()
        assert radio
        for group, robots in scenario.groups().items():
            kind = self._choices[group].gateway_class if group in self._choices else Gateway
            if issubclass(kind, CrazyflieGateway) and (drones := set(robots) & set(scenario.stations())):
                expected = "expected a robot of a group without the gateway crazyflie, where the Crazyradio is"
                raise BadInput(scenario.source, "radio.access.station", f"{expected}; got {names[min(drones)]}")
        access = replace(radio.access_or_default, safelink=True)
        self._scenario = scenario.model_copy(update={"radio": replace(radio, access=access)})
        return self._scenario

    def check(self, arenas: int, runners: int) -> None:
        """Raise BadInput for options that exclude gateways."""
        if arenas > 1:
            raise BadInput("seeds", "", f"expected one seed: robots behind gateways are in one arena, got {arenas}")
        if runners:
            expected = 'expected "none" with gateways: agents of groups without a gateway are in this process'
            raise BadInput("runners", "", expected)

    def sensors(self, needs: Mapping[str, Sequence[str]], bodies: Mapping[str, Body]) -> dict[str, tuple[str, ...]]:
        """Return the sensors to compute, by group: the `needs` of its agent, and those that its gateway serves."""
        served = {
            group: self._choices[group].sensors(bodies[group]) if group in self._choices else () for group in needs
        }
        return {group: tuple(dict.fromkeys([*need, *served[group]])) for group, need in needs.items()}

    @contextmanager
    def serve(
        self,
        world: World,
        agents: Mapping[str, str],
        clock: DatedClock,
        pace: float,
        folder: Path | None,
        report: Callable[[str], None],
        *,
        separate: bool = False,
    ) -> Generator[Served]:
        """Serve all robots behind gateways within the context; BadInput if an address is in use or invalid.

        Args:
            world: the world of the robots.
            agents: the spec of each group's agent.
            clock: the wall clock.
            pace: simulated s per s of wall time.
            folder: the run folder.
            report: receives messages for the user.
            separate: True if robots have networks of their own.
        """
        gateways = self._gateways
        if gateways.network.warning:
            report(gateways.network.warning)
        static, keys, scaled = world.static, SwarmKeys(gateways.swarm), ScaledClock(clock, pace)
        with ExitStack() as stack:
            crazyradio = self._crazyradio(static) if self.has_crazyradio else None
            groups, addresses = self._open(stack, world, scaled, report, crazyradio, separate=separate)
            rows = {static.robot_names[row]: int(row) for group in groups for row in group.rows}
            access = access_of(gateways.network, keys, static.robot_names, gateways.network.tracker)
            radio = self._bridged_radio(static)
            bridge = stack.enter_context(closing(RadioBridge(gateways.network, keys, rows, radio, access)))
            endpoints = bridge.open()
            tracker = EmulatedTracker(bridge.session, keys, scaled)
            tracker.begin(static)
            stack.callback(tracker.end)
            network, listen = gateways.network, free_endpoints(list(rows), gateways.network)
            settings = GatewayRobotSettings(
                self._scenario, static, agents, gateways.swarm, network, endpoints, pace, listen
            )
            robots = [
                _served_robot(settings.robot_table(row, choice, addresses[row]), choice.kind, addresses[row], folder)
                for group in groups
                for choice in [self._choices[group.name]]
                for row in group.rows.tolist()
            ]
            yield Served(
                groups=groups,
                robots=tuple(robots),
                medium=bridge,
                show=lambda: tracker.publish(world.pose, world.alive),
                show_counts=tracker.counts,
                swarm=gateways.swarm,
                endpoints=endpoints,
                crazyradio=crazyradio,
            )

    def _open(
        self,
        stack: ExitStack,
        world: World,
        clock: DatedClock,
        report: Callable[[str], None],
        crazyradio: CrazyradioPorts | None,
        *,
        separate: bool,
    ) -> tuple[tuple[GatewayGroup, ...], dict[int, str]]:
        """Open the gateways, which close with the stack; return them, and each robot's address by its row."""
        static = world.static
        groups: list[GatewayGroup] = []
        addresses: dict[int, str] = {}
        for group in static.groups:
            if group.name in self._choices:
                choice = self._choices[group.name]
                names = static.robot_names[group.start : group.stop]
                gateway = choice.gateway_class(names, group.body, choice.address, choice.options, clock)
                gateway.separate = separate
                if crazyradio and isinstance(gateway, CrazyflieGateway):
                    gateway.join(crazyradio, group.start)
                stack.callback(gateway.close)
                gateway.enter(world.scene, group.start)
                differences = gateway.differences()
                if differences:
                    report(f"{group.name}: body {group.body.name} as {choice.kind}: {'; '.join(differences)}")
                addresses.update(zip(range(group.start, group.stop), gateway.open(), strict=True))
                groups.append(GatewayGroup(group, choice.kind, gateway))
        return tuple(groups), addresses

    def _crazyradio(self, static: Static) -> CrazyradioPorts:
        station = new_polling(self._scenario.stations(), static.robots, 1).station.tolist()
        drones = [row for row in range(static.robots) if station[row] != row]
        return CrazyradioPorts({row: station[row] for row in drones})

    def _bridged_radio(self, static: Static) -> BridgedRadio | None:
        """Return the scenario's radio for agents behind gateways; None without a radio."""
        radio = self._scenario.radio
        if radio is None:
            return None
        return BridgedRadio(
            static.robot_names, static.rate_hz, radio.max_payload_bytes, radio.measures.columns, radio.needs
        )


def _served_robot(settings: dict[str, Any], kind: str, address: str, folder: Path | None) -> ServedRobot:
    file = write_settings(folder, settings) if folder else None
    return ServedRobot(settings["name"], kind, address, settings, file)


GRACE_S = 10.0  # wall time after the start until robots without a command are reported
MAX_NAMES = 6


class Undriven(Observer):
    """Observer that reports robots without a command from any program: these stand still."""

    def __init__(self, served: Served, pace: float, report: Callable[[str], None]) -> None:
        """Observe a run of `pace` simulated s per s of wall time."""
        self._served, self._pace, self._report = served, pace, report
        self._is_reported = False

    def see(self, truth: Truth) -> None:
        """Report the robots once, after the grace time."""
        if not self._is_reported and to_s(truth.time_ns) >= GRACE_S * self._pace:
            self._is_reported = True
            self._report_robots("no program drives")

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Report the robots that no program drove at all."""
        self._report_robots("no program drove")
        return {}

    def _report_robots(self, verb: str) -> None:
        robots = self._undriven()
        if not robots:
            return
        names = abbreviate([robot.name for robot in robots], MAX_NAMES)
        command = robots[0].command
        more = " and so on" if len(robots) > 1 else ""
        self._report(f"{verb} {names}{f': {command}{more}' if command else ''}")

    def _undriven(self) -> list[ServedRobot]:
        """Return the robots here that no program has driven; served robots are in the order of their groups."""
        are_driven = [bool(driven) for group in self._served.groups for driven in group.driven]
        robots = zip(self._served.robots, are_driven, strict=True)
        return [robot for robot, is_driven in robots if robot.address and not is_driven]
