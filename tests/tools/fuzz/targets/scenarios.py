"""Scenarios, bodies and campaigns: TOML files, changed as text and as tables, read where they really lie."""

import shutil
import tomllib
from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import tomli_w

from swarmwire.comms.bodies.body import body_from_mapping
from swarmwire.comms.errors import AgentFailed, BadInput
from swarmwire.comms.toml_file import read_toml
from swarmwire.deploy.agents import agent_specs, check_agents
from swarmwire.deploy.campaign.campaign_file import asked_in, campaign_table
from swarmwire.deploy.campaign.plan import planned
from swarmwire.deploy.measuring import measuring
from swarmwire.deploy.radio.link_trace_file import scenario_traces
from swarmwire.deploy.simulation import Simulation
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario.scenario_file import load_scenario
from tests.tools.fuzz.byte_changes import changed_bytes
from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.target import Target, changed_inside, check_file_line

SHIPPED = Path("scenarios")
WORLDS = 0.005  # of the scenarios that are let in, as many run for a tick
MOST_ROBOTS, MOST_OBSTACLES = 60, 200  # of those that do


class Text(NamedTuple):
    """A file's bytes, and where it lies."""

    place: str
    data: bytes
    deep: bool = False  # whether it goes on to what costs most


class TomlTarget(Target):
    """Of TOML files that lie in the folder of shipped scenarios, so that what they name is there."""

    refusals = (BadInput,)
    inner: ClassVar[tuple[str, ...]] = ()  # tables in which most of a file is

    def make_samples(self) -> Sequence[Text]:
        """All files that `is_one` says are some."""
        shutil.copytree(SHIPPED, self.folder / "all")
        found = [path for path in sorted((self.folder / "all").rglob("*.toml")) if self.is_one(path, read_toml(path))]
        texts = [Text(str(path.with_suffix(".changed.toml")), path.read_bytes()) for path in found]
        self.trees = [tomllib.loads(text.data.decode()) for text in texts]
        self.bytes = [text.data for text in texts]
        return texts

    @abstractmethod
    def is_one(self, path: Path, table: dict[str, Any]) -> bool:
        """Whether a shipped file is one of these."""

    def case(self, dice: Dice) -> Text:
        """A file, its text or its table changed."""
        at = dice.below(len(self.samples))
        sample: Text = self.samples[at]
        if dice.chance(0.3):
            data = changed_bytes(dice, sample.data, self.bytes)
        else:
            try:
                data = tomli_w.dumps(changed_inside(dice, self.trees[at], self.trees, self.inner)).encode()
            except (TypeError, ValueError, AttributeError, RecursionError):  # TOML cannot say it
                data = changed_bytes(dice, sample.data, self.bytes)
        return Text(sample.place, data, dice.chance(WORLDS))

    def door(self, case: Text) -> str | None:
        """Write the file, and read it; a refusal is a line that names a file."""
        path = Path(case.place)
        path.write_bytes(case.data)
        try:
            return self.read(path, case)
        except BadInput as error:
            check_file_line(error)
            raise
        finally:
            path.unlink()

    @abstractmethod
    def read(self, path: Path, case: Text) -> str | None:
        """Read the file."""


class Scenarios(TomlTarget):
    """Scenarios, up to the first tick of small ones."""

    name = "scenarios"
    quick = 150
    limit_s = 20.0  # the first may be compiled for
    inner = ("robots", "radio", "events", "arena")
    refusals = (BadInput, AgentFailed)

    def is_one(self, path: Path, table: dict[str, Any]) -> bool:
        """Not a body, nor a campaign."""
        return "robots" in table and path.suffixes == [".toml"]

    def read(self, path: Path, case: Text) -> str | None:
        """All checks at the door, and the first tick."""
        scenario = load_scenario(path)
        check_agents(scenario, agent_specs(scenario))
        scenario_traces(scenario)
        measuring(scenario)
        if case.deep and _is_small(scenario):
            with Simulation(scenario) as simulation:
                simulation.step()
            return "ran"
        return None


class Bodies(TomlTarget):
    """Bodies' sheets, of the package and of users."""

    name = "bodies"
    inner = ("senses", "drive")

    def make_samples(self) -> Sequence[Text]:
        """The package's bodies, too."""
        import swarmwire.comms.bodies.body as beside

        found = super().make_samples()
        more = [
            Text(str(self.folder / f"{path.stem}.toml"), path.read_bytes())
            for path in sorted(Path(str(beside.__file__)).parent.glob("*.toml"))
        ]
        self.trees += [tomllib.loads(text.data.decode()) for text in more]
        self.bytes += [text.data for text in more]
        return [*found, *more]

    def is_one(self, path: Path, table: dict[str, Any]) -> bool:
        """Those beside the scenarios."""
        return path.parent.name == "bodies" and "radius_m" in table

    def read(self, path: Path, case: Text) -> str | None:
        """The sheet, and its way back."""
        body = body_from_mapping(read_toml(path), str(path))
        if body_from_mapping(body.as_mapping(), str(path)) != body:
            raise AssertionError("a body that is not what was read")
        return None


class Campaigns(TomlTarget):
    """Campaign files, up to the plan of small ones."""

    name = "campaigns"
    quick = 60
    limit_s = 20.0

    def is_one(self, path: Path, table: dict[str, Any]) -> bool:
        """Files that name a scenario."""
        return "scenario" in table and "vary" in table

    def read(self, path: Path, case: Text) -> str | None:
        """What is asked for, and every point of it."""
        table = campaign_table(path)
        if table is None:
            return "a scenario"
        asked = asked_in(path, table)
        if not case.deep:
            return None
        planned(asked)
        return "planned"


def _is_small(scenario: Scenario) -> bool:
    robots = sum(group.count for group in scenario.robots.values())
    obstacles = sum(getattr(of, "count", 1) or 1 for of in scenario.arena.obstacles)
    return robots <= MOST_ROBOTS and obstacles <= MOST_OBSTACLES
