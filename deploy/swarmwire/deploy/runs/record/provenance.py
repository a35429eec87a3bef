"""From what a run was made: `run.json`, written before the first tick, and the scenario as run, in the run folder.

They are enough to run a killed run again; the folder needs the original scenario no more.

    scenario.toml      overrides applied, the seed as run; what was left out stays left out
    files/<name>       agents, metrics, measured links, pictures of the arena, byte for byte; bodies of the user's own
                       with the files of their sensors and actuators, which lie beside them

Other bodies come with swarmwire and are covered by the digests of its parts. An agent file is loaded without its folder
on `sys.path`, so there is nothing beside it that it could have imported; installed modules are not copied but named by
their digests (`modules`). Equal trajectory hashes are promised for one CPU type, and the same code and versions only.
"""

import hashlib
import importlib
import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tomli_w

from swarmwire.comms.base.atomic import make_subfolder, write_bytes, write_text
from swarmwire.comms.base.config import folder_of, from_toml, read_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import ONNX, file_of, resolve, with_file
from swarmwire.deploy.runs.scenario_parts import trace_path
from swarmwire.metrics.records.run_folder.layout import RUN_FORMAT, RUN_JSON, SCENARIO, CopiedFile, MetricInfo
from swarmwire.world.placement.maps import path_near_scenario
from swarmwire.world.scenario.bodies import sheet_path
from swarmwire.world.scenario.scenario import Scenario, mapping_of

PACKAGES = ("swarmwire-comms", "numpy", "numba", "pymunk", "eclipse-zenoh", "msgpack")
PARTS = ("swarmwire.comms", "swarmwire.agent", "swarmwire.world", "swarmwire.metrics", "swarmwire.deploy")
SOURCES = (".py", ".toml")  # code, and the data sheets of bodies


@dataclass(frozen=True)
class RunFacts:
    """From what a run was made, in the order of `run.json`. Paths are within the run folder."""

    seeds: tuple[int, ...]  # of the arenas, in order
    ticks: int  # that the run was to have
    runners: int  # 0: all agents in the world's process
    realtime: float | None  # simulated s per s of wall time; None: lockstep, as fast as may be
    files: tuple[CopiedFile, ...]  # in the run folder, from which the run can be repeated
    modules: Mapping[str, str]  # sha256 of the installed code: swarmwire's parts and packages of agents
    cpu: str
    versions: Mapping[str, str]
    gateways: Mapping[str, str]  # by group: the kind of its gateway, where it has one
    metrics: tuple[MetricInfo, ...]  # that were measured
    subtick_s: float | None  # wall time after which real time woke within ticks; None: packets wait for ticks

    def changes(self, folder: Path, code: Sequence[str]) -> list[str]:
        """What is not as it was when the run of this folder began, a line each; `code`: specs of users' classes."""
        return [*changed_files(self.files, folder), *changes_since(self.modules, self.versions, self.cpu, code)]

    def write(self, folder: Path) -> None:
        """Write `run.json` into the run folder."""
        write_text(folder / RUN_JSON, json.dumps({"format": RUN_FORMAT, **asdict(self)}, indent=2) + "\n")


def read_facts(folder: Path) -> RunFacts:
    """The facts of the run of this folder; BadInput if there are none."""
    path = folder / RUN_JSON
    if not folder.is_dir():
        raise BadInput(str(folder), "", "expected a run folder: there is none")
    found = read_json(RunFacts, path, RUN_FORMAT)
    if not found.seeds or len(set(found.seeds)) < len(found.seeds) or min(*found.seeds, found.ticks, found.runners) < 0:
        raise BadInput(str(path), "", "expected different seeds, and seeds, ticks and runners of at least 0")
    return found


def cpu() -> str:
    """The CPU's model and the vector instructions that numpy uses on it."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(encoding="utf-8").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    return f"{model} ({_simd()})"


def versions() -> dict[str, str]:
    """Python and the packages whose arithmetic a run depends on."""
    return {"python": platform.python_version(), **{package: _version(package) for package in PACKAGES}}


def _simd() -> str:
    from numpy.lib import introspect

    targets = introspect.opt_func_info(func_name="^sin$", signature="float64")
    found = [target["current"] for target in targets.get("sin", {}).values() if target.get("current")]
    return found[0].split(" ")[-1] if found else "baseline"


_version = cache(version)  # reading one takes longer than a tick


def module_digests(specs: Iterable[str]) -> dict[str, str]:
    """sha256 by module: of swarmwire's parts, and of the outermost package around each "package.module:Class".

    The digest is over the source files on the disk, sorted by name; a module that is no package is its one file. Agents
    may be edited and loaded again while a process lives, so theirs are read each time; swarmwire's own, hundreds of
    files, once. What these packages import from others in turn is not followed.
    """
    places = ["onnxruntime" if spec.endswith(ONNX) else spec.rpartition(":")[0] for spec in specs]
    own = [_outermost(place) for place in places if not place.endswith(".py")]
    return {part: _digest_once(part) for part in PARTS} | {name: _digest(name) for name in sorted({*own} - {*PARTS})}


def changes_since(
    modules_then: Mapping[str, str], versions_then: Mapping[str, str], cpu_then: str, code: Iterable[str]
) -> list[str]:
    """What differs from these digests, versions and CPU, a line each; `code`: specs of users' classes."""
    digests, now = module_digests(code), versions()
    return [
        *(f"module {name} has changed since" for name, then in modules_then.items() if digests.get(name) != then),
        *(
            f"{name} is {now.get(name, 'not there')}; it was {then}"
            for name, then in versions_then.items()
            if now.get(name) != then
        ),
        *([f"the CPU is {cpu()}; it was {cpu_then}"] if cpu() != cpu_then else []),
    ]


def _outermost(module: str) -> str:
    """The first part of a dotted name that has a source of its own: `swarmwire` alone is only a name space."""
    names = module.split(".")
    wholes = (".".join(names[: count + 1]) for count in range(len(names)))
    return next((whole for whole in wholes if _origin(whole) is not None), module)


def _origin(module: str) -> Path | None:
    try:
        file: str | None = getattr(importlib.import_module(module), "__file__", None)
    except ImportError:  # it was there when the run began, and is no more
        return None
    return Path(file) if file else None


def _digest(module: str) -> str:
    """Of nothing where a module has no file: built into Python, whose version is named elsewhere."""
    origin, whole = _origin(module), hashlib.sha256()
    if origin is not None:
        root = origin.parent
        is_package = origin.name == "__init__.py"
        files = (path for path in root.rglob("*") if path.suffix in SOURCES) if is_package else (origin,)
        for path in sorted(files, key=lambda path: path.relative_to(root).as_posix()):
            whole.update(f"{path.relative_to(root).as_posix()}\0".encode())
            whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()


_digest_once = cache(_digest)


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
    write_bytes(folder / SCENARIO, text)
    return (CopiedFile(SCENARIO, _sha256(text), "scenario"), *copies.made)


def copied_mapping(scenario: Scenario, copies: "Copies") -> dict[str, Any]:
    """The scenario as a mapping that names copies instead of the files of people, which are copied if need be."""
    mapping = mapping_of(scenario)
    near = folder_of(scenario.source)
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
            table["image"] = copies.add(path_near_scenario(scenario.source, table["image"]).resolve(), what)
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
            make_subfolder(self._folder / FILES)
            write_bytes(self._folder / place, data)
            self._places[original] = place
            self.made.append(CopiedFile(place, _sha256(data), what))
        return self._places[original]

    def class_of(self, spec: str, beside: Path, what: str) -> str:
        """The spec of a class, whose file, if it is of one as seen from `beside`, is copied and named instead."""
        file = file_of(resolve(spec, beside))
        return with_file(spec, self.add(Path(file), what)) if file else spec

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
