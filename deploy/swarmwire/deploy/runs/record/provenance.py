"""Provenance of a run: `run.json`, written before the first tick, and a copy of the scenario, in the run folder.

They suffice to repeat a run, also a killed one, without the original scenario.

    scenario.toml      with the overrides and the seed of the run; omitted keys stay omitted
    files/<name>       agents, metrics, traces, measured links, pictures of the arena, byte for byte; users' bodies with
                       the files of their sensors and actuators

Other bodies come with swarmwire, and the digests of its parts cover them. An agent file is loaded without its folder on
`sys.path`, so it can import no neighbour. Installed modules are not copied; their digests are recorded (`modules`).
Equal trajectory hashes are promised for the same code and versions, on any machine; with the pymunk engine on one CPU
type.
"""

import hashlib
import importlib
import json
import platform
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tomli_w
import yaml

from swarmwire.comms.base.atomic import atomic_write, make_subfolder, write_text
from swarmwire.comms.base.config import folder_of, from_toml, read_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import ONNX, file_of, resolve, with_file
from swarmwire.deploy.runs.scenario_parts import trace_path
from swarmwire.metrics.measures.metric import MetricInfo
from swarmwire.metrics.records.run_folder.layout import RUN_FORMAT, RUN_JSON, SCENARIO, CopiedFile
from swarmwire.world.motion.source import motion_files
from swarmwire.world.motion.traces.reading import files_of
from swarmwire.world.placement.maps import path_near_scenario
from swarmwire.world.scenario.bodies import sheet_path
from swarmwire.world.scenario.scenario import Scenario, mapping_of

PACKAGES = ("swarmwire-comms", "numpy", "numba", "pymunk", "eclipse-zenoh", "msgpack")
PARTS = ("swarmwire.comms", "swarmwire.agent", "swarmwire.world", "swarmwire.metrics", "swarmwire.deploy")
SOURCES = (".py", ".toml")  # code, and the data sheets of bodies


@dataclass(frozen=True)
class RunFacts:
    """The provenance of a run, in the order of `run.json`. Paths are within the run folder."""

    seeds: tuple[int, ...]  #: seed of each arena
    ticks: int  #: planned ticks
    runners: int  #: 0: all agents in the world's process
    realtime: float | None  #: simulated s per s of wall time; None: lockstep, as fast as possible
    files: tuple[CopiedFile, ...]  #: files in the run folder from which the run can be repeated
    modules: Mapping[str, str]  #: sha256 of the installed code: swarmwire's parts and packages of agents
    cpu: str
    versions: Mapping[str, str]
    gateways: Mapping[str, str]  #: kind of the gateway of each group that has one
    metrics: tuple[MetricInfo, ...]
    subtick_s: float | None  #: wall time after which packets crossed between ticks; None: at the starts of ticks

    def changes(self, folder: Path, code: Sequence[str]) -> list[str]:
        """Return the differences between then and now, one line each; `code` has the specs of users' classes."""
        return [*changed_files(self.files, folder), *changes_since(self.modules, self.versions, code)]

    def write(self, folder: Path) -> None:
        """Write `run.json` into the run folder."""
        write_text(folder / RUN_JSON, json.dumps({"format": RUN_FORMAT, **asdict(self)}, indent=2) + "\n")


def read_facts(folder: Path) -> RunFacts:
    """Read the facts of the run of this folder; BadInput without a valid file."""
    path = folder / RUN_JSON
    if not folder.is_dir():
        raise BadInput(str(folder), "", "expected a run folder: there is none")
    facts = read_json(RunFacts, path, RUN_FORMAT)
    if not facts.seeds or len(set(facts.seeds)) < len(facts.seeds) or min(*facts.seeds, facts.ticks, facts.runners) < 0:
        raise BadInput(str(path), "", "expected different seeds, and seeds, ticks and runners of at least 0")
    return facts


def cpu() -> str:
    """Return the CPU's model and the vector instructions that numpy uses on it."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(encoding="utf-8").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    return f"{model} ({_simd()})"


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages whose arithmetic a run depends on."""
    return {"python": platform.python_version(), **{package: _version(package) for package in PACKAGES}}


def _simd() -> str:
    from numpy.lib import introspect

    targets = introspect.opt_func_info(func_name="^sin$", signature="float64")
    names = [target["current"] for target in targets.get("sin", {}).values() if target.get("current")]
    return names[0].split(" ")[-1] if names else "baseline"


_version = cache(version)  # cached, since a read takes longer than a tick


def module_digests(specs: Iterable[str]) -> dict[str, str]:
    """Return the sha256 of swarmwire's parts, and of the outermost package around each "package.module:Class".

    The digest is over the source files on the disk, sorted by name. Digests of agents' packages are computed each time,
    since agents may be edited and loaded again; those of swarmwire's hundreds of files once. Other packages that these
    import are not included.
    """
    names = ["onnxruntime" if spec.endswith(ONNX) else spec.rpartition(":")[0] for spec in specs]
    packages = {_outermost(name) for name in names if not name.endswith(".py")}
    return {part: _digest_once(part) for part in PARTS} | {name: _digest(name) for name in sorted(packages - {*PARTS})}


def changes_since(modules_then: Mapping[str, str], versions_then: Mapping[str, str], code: Iterable[str]) -> list[str]:
    """Return the differences from these digests and versions, one line each; `code`: specs of users' classes."""
    digests, now = module_digests(code), versions()
    return [
        *(f"module {name} has changed since" for name, then in modules_then.items() if digests.get(name) != then),
        *(
            f"{name} is {now.get(name, 'not there')}; it was {then}"
            for name, then in versions_then.items()
            if now.get(name) != then
        ),
    ]


def _outermost(module: str) -> str:
    """Return the first part of a dotted name that has a source file; `swarmwire` alone is only a namespace."""
    names = module.split(".")
    packages = (".".join(names[: count + 1]) for count in range(len(names)))
    return next((package for package in packages if _origin(package) is not None), module)


def _origin(module: str) -> Path | None:
    try:
        file: str | None = getattr(importlib.import_module(module), "__file__", None)
    except ImportError:  # removed since the run began
        return None
    return Path(file) if file else None


def _digest(module: str) -> str:
    """Return the digest of a module's sources, of nothing for a module without a file, such as a built-in one."""
    origin, digest = _origin(module), hashlib.sha256()
    if origin is not None:
        root = origin.parent
        is_package = origin.name == "__init__.py"
        files = (path for path in root.rglob("*") if path.suffix in SOURCES) if is_package else (origin,)
        for path in sorted(files, key=lambda path: path.relative_to(root).as_posix()):
            digest.update(f"{path.relative_to(root).as_posix()}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


_digest_once = cache(_digest)


FILES = "files"


def copy_scenario(scenario: Scenario, seeds: tuple[int, ...], copies: "Copies") -> tuple[CopiedFile, ...]:
    """Write `scenario.toml`, with the first seed, and `files/` into the folder of the copies; return all its files."""
    mapping = copied_mapping(scenario, copies)
    mapping["seed"] = seeds[0]
    text = f"{_header(scenario)}\n{tomli_w.dumps(mapping)}".encode()
    copied = tuple(copies.files)
    copies.write(SCENARIO, text, "scenario")
    return (copies.files[-1], *copied)


def copied_mapping(scenario: Scenario, copies: "Copies") -> dict[str, Any]:
    """Copy the user's files of a scenario; return the scenario as a mapping with the paths of the copies."""
    mapping = mapping_of(scenario)
    folder = folder_of(scenario.source)
    for group in mapping["robots"].values():
        group["agent"] = copies.class_of(group["agent"], folder, "agent")
        body = sheet_path(group["body"], scenario.source)
        if body is not None:
            group["body"] = _copied_body(body, copies)
        if "program" in group:
            files = [folder / part for part in group["program"]]
            copied = [copies.add(file.resolve(), "program") if file.is_file() else "" for file in files]
            group["program"] = [copy or part for copy, part in zip(copied, group["program"], strict=True)]
    if "metrics" in mapping:
        mapping["metrics"] = [copies.metric(item, folder) for item in mapping["metrics"]]
    trace = trace_path(scenario)
    if trace is not None:
        mapping["radio"]["trace"]["file"] = copies.add(trace, "trace")
    for group, path in motion_files(scenario).items():
        mapping["robots"][group]["motion"]["file"] = copies.add_trace(path, "motion")
    for group in mapping["robots"].values():
        if "kind" in group.get("motion", {}):
            group["motion"]["kind"] = copies.class_of(group["motion"]["kind"], folder, "motion")
    if isinstance(scenario.arena.map, str):
        mapping["arena"]["map"] = _copied_nav2_map(path_near_scenario(scenario.source, scenario.arena.map), copies)
    for role in ("map", "ground"):
        table: Any = mapping["arena"].get(role, {})
        if not isinstance(table, str) and "image" in table:
            table["image"] = copies.add(path_near_scenario(scenario.source, table["image"]).resolve(), role)
    if scenario.arena.buildings is not None:
        file = path_near_scenario(scenario.source, scenario.arena.buildings.file).resolve()
        mapping["arena"]["buildings"]["file"] = copies.add(file, "buildings")
    return mapping


def _copied_body(sheet: Path, copies: "Copies") -> str:
    """Copy a body's sheet, with the paths of the copies of its files; return its path within the run folder."""
    body: dict[str, Any] = from_toml(sheet.read_text(encoding="utf-8-sig"))
    body.setdefault("name", sheet.stem)  # the file name of the copy may differ
    for role, tables in (("custom sensor", body.get("sensors", {})), ("custom actuator", body.get("actuators", {}))):
        for table in tables.values():
            if "kind" in table:
                table["kind"] = copies.class_of(table["kind"], sheet.parent, role).removeprefix(f"{FILES}/")
    return copies.add(sheet, "body", tomli_w.dumps(body).encode())


def _copied_nav2_map(file: Path, copies: "Copies") -> str:
    """Copy a map's picture, and its YAML file with the path of the copy; return its path within the run folder."""
    content: dict[str, Any] = yaml.safe_load(file.read_text(encoding="utf-8"))
    image = copies.add((file.parent / content["image"]).resolve(), "map")
    content["image"] = image.removeprefix(f"{FILES}/")
    return copies.add(file.resolve(), "map", yaml.safe_dump(content, sort_keys=False).encode())


def changed_files(files: tuple[CopiedFile, ...], folder: Path) -> list[str]:
    """Return the copied files that have changed, one line each."""
    lines: list[str] = []
    for file in files:
        try:
            if _sha256_of(folder / file.path) != file.sha256:
                lines.append(f"{file.path} is not as the run left it: its sha256 differs")
        except OSError as error:
            lines.append(f"{file.path} cannot be read: {error.strerror}")
    return lines


class Copies:
    """The copies in one folder: one of each original, and different names for originals of one name."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._paths: dict[Path, str] = {}  # path of the copy of each original
        self.files: list[CopiedFile] = []

    def add(self, original: Path, role: str, content: bytes | None = None) -> str:
        """Copy a file once, or write `content` instead; return the path within the run folder."""
        if original not in self._paths:
            self._paths[original] = self._free_path(original)
            self.write(self._paths[original], original if content is None else content, role)
        return self._paths[original]

    def add_trace(self, original: Path, role: str) -> str:
        """Copy a trace once, a file or those of a folder; return the path within the run folder."""
        if original.is_dir() and original not in self._paths:
            self._paths[original] = self._free_path(original)
            for file in files_of(original):
                path = Path(self._paths[original], file.relative_to(original))
                self.write(path.as_posix(), file, role)
        return self.add(original, role)

    def class_of(self, spec: str, folder: Path, role: str) -> str:
        """Copy the file of a class, if it has one, relative to `folder`; return the spec with the path of the copy."""
        file = file_of(resolve(spec, folder))
        return with_file(spec, self.add(Path(file), role)) if file else spec

    def metric(self, item: str | dict[str, Any], folder: Path) -> str | dict[str, Any]:
        """Copy the file of a scenario's metric, given by name, class or table, as `class_of`."""
        if isinstance(item, str):
            return self.class_of(item, folder, "metric")
        return {**item, "metric": self.class_of(item["metric"], folder, "metric")}

    def write(self, path: str, content: bytes | Path, role: str) -> None:
        """Write a file: these bytes, or a copy of another one, in parts since bags may exceed the memory."""
        for parent in reversed(Path(path).parents):
            make_subfolder(self.folder / parent)
        with atomic_write(self.folder / path) as aside:
            if isinstance(content, bytes):
                aside.write_bytes(content)
            else:
                shutil.copy(content, aside)  # also its mode: programs are executable
            self.files.append(CopiedFile(path, _sha256_of(aside), role))

    def _free_path(self, original: Path) -> str:
        used, path, number = set(self._paths.values()), f"{FILES}/{original.name}", 1
        while path in used:
            number += 1
            path = f"{FILES}/{original.stem}-{number}{original.suffix}"
        return path


def _header(scenario: Scenario) -> str:
    source = Path(scenario.source).name or "a Scenario made in Python"
    return f"# As run by swarmwire {version('swarmwire-deploy')}, from {source}, with overrides and seed as run.\n"


def _sha256_of(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
