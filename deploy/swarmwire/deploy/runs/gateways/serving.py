"""The gateways of a run: robots that answer as real ones during the run."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Any

from swarmwire.comms.base.clock import DatedClock, ScaledClock, to_s
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.wire.access_control import access_of
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.deploy.machine import program
from swarmwire.deploy.runs.gateways.gateways import (
    GatewayChoice,
    GatewayRobotSettings,
    Gateways,
    chosen_gateways,
    listening_places,
    write_settings,
)
from swarmwire.metrics.text import some
from swarmwire.world.gateways.backend import GatewayGroup
from swarmwire.world.gateways.radio_bridge import BridgedRadio, EmulatedTracker, RadioBridge
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.world import World


@dataclass(frozen=True)
class ServedRobot:
    """A robot of a run that answers as a real one."""

    name: str
    kind: str  # of its gateway, and of the driver that speaks with it
    address: str  # as that driver takes it
    settings: Mapping[str, Any]  # of `swarmwire-agent`, as in `robot.toml`
    file: Path | None  # where these are written, if the run has a folder

    @property
    def command(self) -> str | None:
        """The command that drives it, to be copied into a shell; None without a run folder."""
        if self.file is None:
            return None
        return f"{quote(str(program('swarmwire-agent')))} run --config {quote(str(self.file))}"


@dataclass(frozen=True)
class Served:
    """All of them, ready to answer."""

    groups: tuple[GatewayGroup, ...]
    robots: tuple[ServedRobot, ...]
    medium: RadioBridge | None
    show: Callable[[], None]  # tells where all robots are
    show_counts: Callable[[], dict[str, int]]  # what of that nobody was told
    swarm: str
    endpoints: tuple[str, ...]  # of the network

    def on_robots(self) -> dict[int, tuple[str, str]]:
        """By robot index, its gateway's address on a robot with a network of its own, and outside."""
        placed = ((row, group.gateway) for group in self.groups for row in group.rows.tolist())
        return {
            row: (gateway.on_robot(robot.address), robot.address)
            for (row, gateway), robot in zip(placed, self.robots, strict=True)
        }


class RunGateways:
    """The gateways of one run, of which there may be none.

    Attributes:
        kinds: by group, the kind of its gateway.
    """

    def __init__(self, gateways: Gateways | None, scenario: Scenario) -> None:
        """BadInput for a group, a kind or an option that is not there."""
        self._gateways, self._scenario = gateways, scenario
        if gateways:
            gateways.network.check("gateways")
        self._chosen: Mapping[str, GatewayChoice] = chosen_gateways(gateways, scenario) if gateways else {}
        self.kinds = {group: chosen.kind for group, chosen in self._chosen.items()}

    def factor(self, asked: float | None) -> float | None:
        """The factor of real time, which gateways imply."""
        return 1.0 if asked is None and self._chosen else asked

    def check(self, arenas: int, runners: int) -> None:
        """BadInput where gateways do not go together with what else was asked for."""
        if self._chosen and arenas > 1:
            raise BadInput("--seeds", "", f"expected one seed: robots behind gateways are in one arena, got {arenas}")
        if self._chosen and runners:
            expected = 'expected "none" with --gateway: agents of groups without a gateway are in this process'
            raise BadInput("--runners", "", expected)

    def sensors(self, needs: Mapping[str, Sequence[str]], bodies: Mapping[str, Body]) -> dict[str, tuple[str, ...]]:
        """The sensors to compute, by group: what its agent needs and, behind a gateway, also all that this serves."""
        told = {group: self._chosen[group].sensors(bodies[group]) if group in self._chosen else () for group in needs}
        return {group: tuple(dict.fromkeys([*need, *told[group]])) for group, need in needs.items()}

    @contextmanager
    def served(
        self,
        world: World,
        agents: Mapping[str, str],
        clock: DatedClock,
        pace: float,
        folder: Path | None,
        say: Callable[[str], None],
        *,
        separate: bool = False,
    ) -> Generator[Served | None]:
        """All robots behind gateways answer within the context; None if there are none.

        `agents` names the spec of each group's agent; `say` receives messages for the user; `separate`: robots have
        networks of their own. BadInput if an address is taken, or will not do.
        """
        gateways = self._gateways
        if gateways is None:
            yield None
            return
        if gateways.network.warning:
            say(gateways.network.warning)
        static, keys, scaled = world.static, SwarmKeys(gateways.swarm), ScaledClock(clock, pace)
        with ExitStack() as stack:
            groups, addresses = self._open(stack, world, scaled, say, separate=separate)
            rows = {static.robot_names[row]: int(row) for group in groups for row in group.rows}
            access = access_of(gateways.network, keys, static.robot_names, gateways.network.tracker)
            bridge = stack.enter_context(closing(RadioBridge(gateways.network, keys, rows, self._lent(static), access)))
            endpoints = bridge.open()
            tracker = EmulatedTracker(bridge.session, keys, scaled)
            tracker.begin(static)
            stack.callback(tracker.end)
            network, listens = gateways.network, listening_places(list(rows), gateways.network)
            settings = GatewayRobotSettings(
                self._scenario, static, agents, gateways.swarm, network, endpoints, pace, listens
            )
            robots = [
                self._robot(settings.robot_table(row, self._chosen[group.name], addresses[row]), group.kind, folder)
                for group in groups
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
            )

    def _open(
        self, stack: ExitStack, world: World, clock: DatedClock, say: Callable[[str], None], *, separate: bool
    ) -> tuple[tuple[GatewayGroup, ...], dict[int, str]]:
        """The gateways, closed with the stack, and each robot's address by its row."""
        static = world.static
        groups: list[GatewayGroup] = []
        addresses: dict[int, str] = {}
        for group in static.groups:
            if group.name in self._chosen:
                chosen = self._chosen[group.name]
                names = static.robot_names[group.start : group.stop]
                gateway = chosen.made(names, group.body, chosen.address, chosen.options, clock)
                gateway.separate = separate
                stack.callback(gateway.close)
                gateway.enter(world.scene, group.start)
                differences = gateway.differences()
                if differences:
                    say(f"{group.name}: body {group.body.name} as {chosen.kind}: {'; '.join(differences)}")
                addresses.update(zip(range(group.start, group.stop), gateway.open(), strict=True))
                groups.append(GatewayGroup(group, chosen.kind, gateway))
        return tuple(groups), addresses

    def _robot(self, settings: dict[str, Any], kind: str, folder: Path | None) -> ServedRobot:
        file = write_settings(folder, settings) if folder else None
        return ServedRobot(settings["name"], kind, settings["driver"]["address"], settings, file)

    def _lent(self, static: Static) -> BridgedRadio | None:
        """What the scenario's radio is to agents elsewhere."""
        radio = self._scenario.radio
        if radio is None:
            return None
        told = radio.max_payload_bytes, radio.measures.columns, radio.needs
        return BridgedRadio(static.robot_names, static.rate_hz, *told)


GRACE_S = 10.0  # wall time after the start, by which people have begun to drive what they mean to
NAMED = 6  # robots, at most


class Undriven(Observer):
    """Observer that reports robots without a command from any program: these stand still."""

    def __init__(self, served: Served, pace: float, say: Callable[[str], None]) -> None:
        """`pace` is of the run, in simulated seconds per second of wall time."""
        self._served, self._pace, self._say = served, pace, say
        self._told = False

    def see(self, truth: Truth) -> None:
        """Report them once, when they could be driven."""
        if not self._told and to_s(truth.time_ns) >= GRACE_S * self._pace:
            self._told = True
            self._tell("no program drives")

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Report those that no program drove at all."""
        self._tell("no program drove")
        return {}

    def _tell(self, verb: str) -> None:
        robots = self._robots()
        if not robots:
            return
        names = some([robot.name for robot in robots], NAMED)
        command = robots[0].command
        more = " and so on" if len(robots) > 1 else ""
        self._say(f"{verb} {names}{f': {command}{more}' if command else ''}")

    def _robots(self) -> list[ServedRobot]:
        """Those that no program has driven; the served are in the order of their groups."""
        driven = [bool(driven) for group in self._served.groups for driven in group.driven]
        return [robot for robot, moved in zip(self._served.robots, driven, strict=True) if not moved]
