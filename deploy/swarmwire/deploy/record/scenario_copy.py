"""The scenario as run, in the run folder, with the files that it names: the folder needs the original no more.

    scenario.toml      overrides applied, the seed as run; what was left out stays left out
    files/<name>       agents, metrics, measured links, pictures of the arena, byte for byte; bodies of the user's own
                       with the files of their sensors and actuators, which lie beside them

Other bodies come with swarmwire and are covered by the digests of its parts. An agent file is loaded without its folder
on `sys.path`, so there is nothing beside it that it could have imported; installed modules are not copied but named by
their digests (`modules`).
"""

import hashlib
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tomli_w

from swarmwire.comms.config import from_toml
from swarmwire.comms.plugins import resolve
from swarmwire.deploy.scenario_parts import trace_path
from swarmwire.metrics.campaign.spec import CopiedFile
from swarmwire.metrics.run_folder.layout import SCENARIO
from swarmwire.world.placement.maps import beside
from swarmwire.world.scenario.bodies import sheet_path
from swarmwire.world.scenario.scenario import Scenario, mapping_of

FILES = "files"


def copy_scenario(
    scenario: Scenario, seeds: tuple[int, ...], folder: Path, copies: "Copies | None" = None
) -> tuple[CopiedFile, ...]:
    """Write `scenario.toml` and `files/` into the run folder; with several seeds the scenario says the first.

    `copies` are those that the folder has already.
    """
    copies = copies or Copies(folder)
    mapping = copied_mapping(scenario, copies)
    mapping["seed"] = seeds[0]
    text = f"{_header(scenario)}\n{tomli_w.dumps(mapping)}".encode()
    (folder / SCENARIO).write_bytes(text)
    return (CopiedFile(SCENARIO, _sha256(text), "scenario"), *copies.made)


def copied_mapping(scenario: Scenario, copies: "Copies") -> dict[str, Any]:
    """The scenario as a mapping that names copies instead of the files of people, which are copied if need be."""
    mapping = mapping_of(scenario)
    near = Path(scenario.source).parent
    for group in mapping["robots"].values():
        group["agent"] = copies.class_of(group["agent"], near, "agent")
        body = sheet_path(group["body"], scenario.source)
        if body is not None:
            group["body"] = _copied_body(body, copies)
    if "metrics" in mapping:
        mapping["metrics"] = [copies.metric(item, near) for item in mapping["metrics"]]
    trace = trace_path(scenario)
    if trace is not None:
        mapping["radio"]["trace"]["file"] = copies.add(trace, "trace")
    for what in ("map", "ground"):
        table = mapping["arena"].get(what, {})
        if "image" in table:
            table["image"] = copies.add(beside(scenario.source, table["image"]).resolve(), what)
    return mapping


def _copied_body(sheet: Path, copies: "Copies") -> str:
    """The path within the run folder of a body's sheet, which names the copies of its files."""
    body: dict[str, Any] = from_toml(sheet.read_text(encoding="utf-8-sig"))
    body.setdefault("name", sheet.stem)  # the copy's may be another
    for what, tables in (("custom sensor", body.get("sensors", {})), ("custom actuator", body.get("actuators", {}))):
        for table in tables.values():
            if "kind" in table:
                table["kind"] = copies.class_of(table["kind"], sheet.parent, what).removeprefix(f"{FILES}/")
    return copies.add(sheet, "body", tomli_w.dumps(body).encode())


def changed_files(files: tuple[CopiedFile, ...], folder: Path) -> list[str]:
    """The copied files that are not as they were any more, a line each."""
    lines: list[str] = []
    for file in files:
        try:
            if _sha256((folder / file.path).read_bytes()) != file.sha256:
                lines.append(f"{file.path} is not as the run left it: its sha256 differs")
        except OSError as error:
            lines.append(f"{file.path} cannot be read: {error.strerror}")
    return lines


class Copies:
    """The files of one run folder: each original once, two of one name under different names."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._places: dict[Path, str] = {}
        self.made: list[CopiedFile] = []

    def add(self, original: Path, what: str, content: bytes | None = None) -> str:
        """Copy a file unless it has been, or keep `content` in its place; its path within the run folder."""
        if original not in self._places:
            place = self._free(original)
            data = original.read_bytes() if content is None else content
            (self._folder / FILES).mkdir(exist_ok=True)
            (self._folder / place).write_bytes(data)
            self._places[original] = place
            self.made.append(CopiedFile(place, _sha256(data), what))
        return self._places[original]

    def class_of(self, spec: str, beside: Path, what: str) -> str:
        """The spec of a class, whose file, if it is of one as seen from `beside`, is copied and named instead."""
        path, _, name = resolve(spec, beside).rpartition(":")
        return f"{self.add(Path(path), what)}:{name}" if path.endswith(".py") else spec

    def metric(self, item: str | dict[str, Any], beside: Path) -> str | dict[str, Any]:
        """A metric that a scenario lists, by name, class or table; the file of a class as for `class_of`."""
        if isinstance(item, str):
            return self.class_of(item, beside, "metric")
        return {**item, "metric": self.class_of(item["metric"], beside, "metric")}

    def _free(self, original: Path) -> str:
        taken, place, number = set(self._places.values()), f"{FILES}/{original.name}", 1
        while place in taken:
            number += 1
            place = f"{FILES}/{original.stem}-{number}{original.suffix}"
        return place


def _header(scenario: Scenario) -> str:
    source = Path(scenario.source).name or "a Scenario made in Python"
    return f"# As run by swarmwire {version('swarmwire-deploy')}, from {source}, with overrides and seed as run.\n"


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
