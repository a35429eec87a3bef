"""Classes of users and of installed packages, loaded by name: agents, sensors, actuators, metrics, models.

An installed package declares its classes as entry points of a group: `installed_class` imports one by its name. A
scenario names a class of its user as "package.module:Class" or "file.py:Class": `load_named` imports it, and
`custom_class` also checks its base class.
"""

import hashlib
import importlib
import importlib.util
import sys
from dataclasses import is_dataclass
from difflib import get_close_matches
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from traceback import extract_tb
from types import CodeType
from typing import TYPE_CHECKING, Any, TypeVar, cast

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import Extra

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")
ONNX = ".onnx"  # suffix of a trained policy, which is a complete agent


class NotLoaded(ValueError):
    """A text names no object that can be loaded; the message gives the reason."""


def entry_points_of(group: str) -> "tuple[EntryPoint, ...]":
    """Return the entry points of a group, in no order; cached until `sys.path` changes."""
    return _entry_points_of(group, tuple(sys.path))


@cache
def _entry_points_of(group: str, _path: tuple[str, ...]) -> "tuple[EntryPoint, ...]":
    from importlib.metadata import entry_points  # 3 MB that a runner does not need

    return tuple(entry_points(group=group))


def installed_points(group: str) -> "dict[str, tuple[EntryPoint, ...]]":
    """Return the entry points of a group by sorted name; several for a name that several packages declare."""
    by_name: dict[str, tuple[EntryPoint, ...]] = {}
    for point in sorted(entry_points_of(group), key=lambda point: point.name):
        by_name[point.name] = (*by_name.get(point.name, ()), point)
    return by_name


def installed_class(group: str, name: str, base: type[T], noun: str, where: str, key: str) -> type[T]:
    """Import the subclass of `base` with this name; `noun` is the word for it in errors.

    BadInput at `where` and `key` gives the reason in one line: an unknown name, several packages that declare it, a
    missing package and the command that installs it, or an object that is no such class.
    """
    points = installed_points(group)
    if name not in points:
        raise BadInput(where, key, f"expected a {noun}: {did_you_mean(points, name)}; got {name!r}")
    if len({point.value for point in points[name]}) > 1:
        declared = ", ".join(f"{point.value} of {_package(point)}" for point in points[name])
        raise BadInput(where, key, f"expected one {noun} of the name {name!r}, got {declared}")
    point = points[name][0]
    try:
        kind: object = point.load()
    except ImportError as error:
        raise BadInput(where, key, f"the {noun} {name} does not import: {error}{_remedy(point, error)}") from error
    except AttributeError as error:
        raise BadInput(where, key, f"the {noun} {name} is missing in {_package(point)}: {error}") from error
    if not isinstance(kind, type) or not issubclass(kind, base):
        other = cast("object", kind)
        raise BadInput(where, key, f"expected a {base.__name__}, got {point.value}, which is {other!r}")
    return kind


def _package(point: "EntryPoint") -> str:
    return point.dist.name if point.dist else "an unknown package"


def _remedy(point: "EntryPoint", error: ImportError) -> str:
    """Return the command that installs the missing package, if an extra has the name of the entry point."""
    extras = point.dist.metadata.get_all("Provides-Extra") or [] if point.dist else []
    missing = error.name or "" if isinstance(error, ModuleNotFoundError) else ""
    is_class_module = f"{point.module}.".startswith(f"{missing}.")  # no extra installs the class's module
    if not missing or is_class_module or point.name not in extras:
        return ""
    return f": {Extra(f'{_package(point)}[{point.name}]', ()).remedy()}"


def file_of(spec: str) -> str:
    """Return the file in a spec: "flock.py" of "flock.py:Flock", and a policy "flock.onnx" itself; else ""."""
    if spec.endswith(ONNX):
        return spec
    source = spec.rpartition(":")[0]
    return source if source.endswith(".py") else ""


def with_file(spec: str, file: str) -> str:
    """Return the spec with another file."""
    return file + spec[len(file_of(spec)) :]


def resolve(spec: str, folder: Path) -> str:
    """Return the spec with an absolute path: "my_agent.py:Mine" is relative to `folder`."""
    file = file_of(spec)
    return with_file(spec, str((folder / file).resolve())) if file and "\0" not in file else spec


def custom_class(base: type[T], spec: str, where: str, key: str) -> type[T]:
    """Load the dataclass below `base` that a spec names, with `load_named`; BadInput at `key` otherwise.

    A class with an abstract method is refused too.
    """
    try:
        kind = load_named(spec)
    except NotLoaded as error:
        raise BadInput(where, key, str(error)) from error
    if not isinstance(kind, type) or not issubclass(kind, base) or not is_dataclass(kind):
        got = f"{spec} is {cast('object', kind)!r}"
        raise BadInput(where, key, f"expected a dataclass below {base.__name__}; {got}")
    missing: frozenset[str] = getattr(kind, "__abstractmethods__", frozenset())
    if missing:
        raise BadInput(where, key, f"{kind.__name__} has no {', '.join(sorted(missing))}")
    return kind


def load_named(spec: str) -> object:
    """Load the object that "package.module:Name" or "/path/file.py:Name" names.

    NotLoaded if the text has another form, the module or file does not import, or the name is not defined in it. A
    file is loaded alone: its folder is not added to `sys.path`, so the file can import installed packages and no file
    of its folder. An edited file is loaded again, also in a notebook.
    """
    source, _, name = spec.rpartition(":")
    if not source or not name.isidentifier():
        raise NotLoaded(f'expected "package.module:Class" or "file.py:Class", got {spec!r}')
    is_path = source.endswith(".py")
    if is_path and not _is_file(Path(source)):
        raise NotLoaded(f"there is no file {source}")
    try:
        module = _load_file(Path(source)) if is_path else importlib.import_module(source)
    except (Exception, SystemExit) as error:
        raise NotLoaded(f"{source} does not import: {type(error).__name__}: {error}{_hint(error, source)}") from error
    if not hasattr(module, name):
        close = "".join(f" (did you mean {match}?)" for match in get_close_matches(name, dir(module), n=1))
        raise NotLoaded(f"{source} holds no such name: {name!r}{close}")
    return getattr(module, name)


def _hint(error: BaseException, path: str) -> str:
    """Return the number of the line that failed, and the reason if the file imports another file of its folder."""
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == path]
    hint = f" (line {lines[-1]})" if lines else ""
    missing = error.name or "" if isinstance(error, ModuleNotFoundError) else ""
    if missing.isidentifier() and _is_file(Path(path).with_name(f"{missing}.py")):
        hint += "; a file is loaded alone: it can import installed packages, but no files of its folder"
    return hint


def _is_file(path: Path) -> bool:
    """Return True if the file exists; False for a name that is too long."""
    try:
        return path.is_file()
    except OSError:
        return False


class _SourceLoader(SourceFileLoader):
    """Loads a source file without bytecode, which is matched by size and seconds, and fills users' folders."""

    def get_code(self, fullname: str) -> CodeType:
        """Compile the current source."""
        return self.source_to_code(self.get_data(self.path), self.path)


def _load_file(path: Path) -> Any:
    # The module's name contains a hash of path and content: two files called agent.py differ in sys.modules, and an
    # edited file is another module.
    digest = hashlib.sha256(str(path).encode() + b"\0" + path.read_bytes()).hexdigest()
    name = f"swarmwire_user_{path.stem}_{digest[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path, loader=_SourceLoader(name, str(path)))
    if spec is None or spec.loader is None:
        raise FileNotFoundError(path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:  # includes an exit or Ctrl-C: the next import must not get an incomplete module
        del sys.modules[name]
        raise
    return module
