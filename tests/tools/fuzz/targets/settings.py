"""Files that people write: scenarios, bodies, campaigns, fleets, settings of robots, the register of certificates."""

import json
import shutil
from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from hypothesis.strategies import DrawFn

from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.base.config import read_toml
from swarmwire.comms.base.errors import AgentFailed, BadInput
from swarmwire.comms.robot.bodies import body as body_module
from swarmwire.comms.robot.bodies.body import body_from_mapping
from swarmwire.deploy.campaigns.spec import campaign_file, plan_of, spec_in
from swarmwire.deploy.robots.certificates.member import access_in, network_in
from swarmwire.deploy.robots.certificates.register import Register
from swarmwire.deploy.robots.fleet_file import read_fleet
from swarmwire.deploy.robots.release import robot_settings
from swarmwire.deploy.runs.scenario_parts import agent_specs, check_agents, scenario_traces, selected_metrics
from swarmwire.deploy.runs.simulation import Simulation
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario
from tests.tools.fuzz.mutations import one_in, pick
from tests.tools.fuzz.target import File, FolderTarget, Target, check_refusal, mutated_file
from tests.unit.agent.on_robot.test_settings import ALL_SETTINGS
from tests.unit.deploy.fleet.test_fleet import EXAMPLE

MAX_ROBOTS, MAX_OBSTACLES = 60, 200  # of scenarios that are run for a tick


class TomlTarget(Target):
    """Of TOML files beside copies of the shipped scenarios, so that the files that they name exist."""

    refusals = (BadInput,)
    quick = 30
    per_example = 1
    inner: ClassVar[tuple[str, ...]] = ()
    deep: ClassVar[int] = 200  # one case of so many is deep

    def make_samples(self) -> Sequence[File]:
        shutil.copytree("scenarios", self.folder / "all")
        paths = sorted((self.folder / "all").rglob("*.toml"))
        return [
            File(str(path.with_suffix(".mutated.toml")), path.read_bytes())
            for path in paths
            if self.is_sample(path, read_toml(path))
        ]

    @abstractmethod
    def is_sample(self, path: Path, table: dict[str, Any]) -> bool:
        """Whether a shipped file is of this kind."""

    @abstractmethod
    def read(self, path: Path, *, deep: bool) -> str | None:
        """Read the file; BadInput names a file."""

    def mutated(self, draw: DrawFn) -> Any:
        file = pick(draw, self.samples)
        return File(file.name, mutated_file(draw, file, self.samples, self.inner), one_in(draw, self.deep))

    def feed(self, case: File) -> str | None:
        path = Path(case.name)
        path.write_bytes(case.data or b"")
        try:
            return self.read(path, deep=case.deep)
        except BadInput as error:
            check_refusal(error)
            raise
        finally:
            path.unlink()


class Scenarios(TomlTarget):
    """Scenarios: all checks of a run; deep cases that are small run for a tick."""

    name = "scenarios"
    quick = 50
    limit_s = 20.0  # kernels may be compiled
    inner = ("robots", "radio", "events", "arena")
    refusals = (BadInput, AgentFailed)

    def is_sample(self, path: Path, table: dict[str, Any]) -> bool:
        return "robots" in table and path.suffixes == [".toml"]

    def read(self, path: Path, *, deep: bool) -> str | None:
        scenario = load_scenario(path)
        check_agents(scenario, agent_specs(scenario))
        scenario_traces(scenario)
        selected_metrics(scenario)
        if deep and _is_small(scenario):
            with Simulation(scenario) as simulation:
                simulation.step()
        return None


def _is_small(scenario: Scenario) -> bool:
    robots = sum(group.count for group in scenario.robots.values())
    obstacles = sum(getattr(obstacle, "count", 1) or 1 for obstacle in scenario.arena.obstacles)
    return robots <= MAX_ROBOTS and obstacles <= MAX_OBSTACLES


class Bodies(TomlTarget):
    """Body files of the package and of the scenarios; written again, they say the same."""

    name = "bodies"
    inner = ("sensors", "drive")

    def make_samples(self) -> Sequence[File]:
        shipped = sorted(Path(str(body_module.__file__)).parent.glob("*.toml"))
        more = [File(str(self.folder / path.name), path.read_bytes()) for path in shipped]
        return [*super().make_samples(), *more]

    def is_sample(self, path: Path, table: dict[str, Any]) -> bool:
        return path.parent.name == "bodies" and "radius_m" in table

    def read(self, path: Path, *, deep: bool) -> None:
        body = body_from_mapping(read_toml(path), str(path))
        if body_from_mapping(body.as_mapping(), str(path)) != body:
            raise AssertionError("a body that is not what was read")


class Campaigns(TomlTarget):
    """Campaign files; deep cases up to the plan of their runs."""

    name = "campaigns"
    limit_s = 20.0

    def is_sample(self, path: Path, table: dict[str, Any]) -> bool:
        return "scenario" in table and "vary" in table

    def read(self, path: Path, *, deep: bool) -> str | None:
        file = campaign_file(path)
        if file is None:
            return "a scenario"
        spec = spec_in(path, file)
        if deep:
            plan_of(spec)
        return None


class Fleets(FolderTarget):
    """Fleet files, and the settings of each robot in them."""

    name = "fleet"
    inner = ("robots", "defaults", "groups")

    def make(self, folder: Path) -> None:
        shutil.copytree(EXAMPLE.parent, folder)

    def is_read(self, path: Path) -> bool:
        return path.name == EXAMPLE.name

    def read(self, folder: Path, *, deep: bool) -> None:
        fleet = read_fleet(folder / EXAMPLE.name)
        for robot in fleet.robots:
            robot_settings(fleet, robot, ())


class RobotSettings(FolderTarget):
    """Settings of a robot."""

    name = "robot-settings"
    inner = ("driver", "radio", "network")

    def make(self, folder: Path) -> None:
        folder.mkdir()
        (folder / "robot.toml").write_text(ALL_SETTINGS)

    def read(self, folder: Path, *, deep: bool) -> None:
        read_settings(folder / "robot.toml", {})


class Certificates(FolderTarget):
    """The register of a CA's folder with a revoked certificate, and the access that follows from it."""

    name = "certificates"
    inner = ("certificates", "authority")

    def make(self, folder: Path) -> None:
        folder.mkdir()
        dates = {"valid_from": "2026-01-01T00:00:00Z", "valid_until": "2027-01-01T00:00:00Z"}
        issued = {"serial": "1f", "revoked": None, "hosts": ["10.0.0.1"], **dates}
        certificates = [
            {"name": "world", "purpose": "world", **issued},
            {"name": "one", "purpose": "runner", **issued, "revoked": "2026-06-01T00:00:00Z"},
        ]
        register = {"format": 1, "authority": {"name": "ca", "purpose": "ca", **issued}, "certificates": certificates}
        (folder / "certs.json").write_text(json.dumps(register))
        for name in ("ca.pem", "world.pem", "world.key"):
            (folder / name).write_text("a certificate, or a key\n")
            (folder / name).chmod(0o600)

    def is_read(self, path: Path) -> bool:
        return path.name == "certs.json"

    def read(self, folder: Path, *, deep: bool) -> None:
        Register.read(folder)
        access_in(folder)
        network_in(folder, "world", "world")
