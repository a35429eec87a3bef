"""Classes that installed packages bring, by entry points: known by name, imported where somebody asks for one."""

import hashlib
import importlib
import importlib.util
import sys
from dataclasses import is_dataclass
from difflib import get_close_matches
from functools import cache
from importlib.machinery import SourceFileLoader
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from traceback import extract_tb
from types import CodeType
from typing import Any, TypeVar, cast

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput

T = TypeVar("T")


def entry_points_of(group: str) -> tuple[EntryPoint, ...]:
    """The entry points of a group, in no order. The packages are read once, and again if `sys.path` is another."""
    return _entry_points_of(group, tuple(sys.path))


@cache
def _entry_points_of(group: str, _path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    return tuple(entry_points(group=group))


def installed_points(group: str) -> dict[str, tuple[EntryPoint, ...]]:
    """The entry points of a group, by name in its order; more than one: several packages bring that name."""
    found: dict[str, tuple[EntryPoint, ...]] = {}
    for point in sorted(entry_points_of(group), key=lambda point: point.name):
        found[point.name] = (*found.get(point.name, ()), point)
    return found


def installed_class(group: str, name: str, base: type[T], what: str, where: str, key: str) -> type[T]:
    """The class below `base` of that name; `what` it is called in errors.

    BadInput at `where` and `key` says what is amiss in one line: no such name, several packages that bring it, what to
    install, or that it is no such class.
    """
    points = installed_points(group)
    if name not in points:
        raise BadInput(where, key, f"expected a {what}: {did_you_mean(points, name)}; got {name!r}")
    if len({point.value for point in points[name]}) > 1:
        brought = ", ".join(f"{point.value} of {_package(point)}" for point in points[name])
        raise BadInput(where, key, f"expected one {what} of the name {name!r}, got {brought}")
    point = points[name][0]
    try:
        kind: object = point.load()
    except ImportError as error:
        raise BadInput(where, key, f"the {what} {name} does not import: {error}{_cure(point, error)}") from error
    except AttributeError as error:
        raise BadInput(where, key, f"the {what} {name} is not what {_package(point)} says: {error}") from error
    if not isinstance(kind, type) or not issubclass(kind, base):
        found = cast("object", kind)
        raise BadInput(where, key, f"expected a {base.__name__}, got {point.value}, which is {found!r}")
    return kind


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist else "an unknown package"


def _cure(point: EntryPoint, error: ImportError) -> str:
    """What to install, where the package has an extra of that name."""
    extras = point.dist.metadata.get_all("Provides-Extra") or [] if point.dist else []
    missing = error.name or "" if isinstance(error, ModuleNotFoundError) else ""
    own = f"{point.module}.".startswith(f"{missing}.")  # the class's own module, which no extra brings
    if not missing or own or point.name not in extras:
        return ""
    return f": pip install '{_package(point)}[{point.name}]'"


# --- From the text that names a class of a user's to the class: an agent, a sensor, an actuator.
#
# A file is loaded alone: its folder does not come onto `sys.path`, so it imports what is installed and nothing that
# merely lies beside it. Its content is part of its module's name: an edited file is loaded anew, also in a notebook.


class NotLoaded(ValueError):
    """The text does not lead to anything; the message says at which point."""


def resolve(spec: str, beside: Path) -> str:
    """The spec with the path of a file made absolute: "my_agent.py:Mine" lies beside the scenario."""
    place, _, name = spec.rpartition(":")
    return f"{(beside / place).resolve()}:{name}" if place.endswith(".py") and "\0" not in place else spec


def load_named(spec: str) -> object:
    """What "package.module:Name" or "/path/file.py:Name" is.

    NotLoaded if the text has another form, the module or file does not import, or there is no such name in it.
    """
    place, _, name = spec.rpartition(":")
    if not place or not name.isidentifier():
        raise NotLoaded(f'expected "package.module:Class" or "file.py:Class", got {spec!r}')
    of_file = place.endswith(".py")
    if of_file and not _is_file(Path(place)):
        raise NotLoaded(f"there is no file {place}")
    try:
        module = _load_file(Path(place)) if of_file else importlib.import_module(place)
    except (Exception, SystemExit) as error:
        raise NotLoaded(f"{place} does not import: {type(error).__name__}: {error}{_hint(error, place)}") from error
    if not hasattr(module, name):
        near = "".join(f" (did you mean {other}?)" for other in get_close_matches(name, dir(module), n=1))
        raise NotLoaded(f"{place} holds no such name: {name!r}{near}")
    return getattr(module, name)


def _hint(error: BaseException, place: str) -> str:
    """In which line of the file it was, and what is amiss if that imports a file beside it."""
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == place]
    hint = f" (line {lines[-1]})" if lines else ""
    missing = error.name or "" if isinstance(error, ModuleNotFoundError) else ""
    if missing.isidentifier() and _is_file(Path(place).with_name(f"{missing}.py")):
        hint += "; a file is loaded alone: it imports what is installed, not what lies beside it"
    return hint


def _is_file(path: Path) -> bool:
    """Whether there is such a file; not with a name that is too long for any."""
    try:
        return path.is_file()
    except OSError:
        return False


class _SourceLoader(SourceFileLoader):
    """Neither reads nor leaves bytecode, which knows its source by size and whole seconds, and litters folders."""

    def get_code(self, fullname: str) -> CodeType:
        """The compiled source, as it is now."""
        return self.source_to_code(self.get_data(self.path), self.path)


def _load_file(path: Path) -> Any:
    # A name of its own, so that two files called agent.py do not meet in sys.modules.
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
    except BaseException:  # also an exit or Ctrl-C: a half-imported module must not be found the next time
        del sys.modules[name]
        raise
    return module


# --- A class of the user's own that the program makes instances of: found, and known to be of the kind that is wanted.


K = TypeVar("K")


def custom_class(base: type[K], spec: str, where: str, key: str) -> type[K]:
    """The whole dataclass below `base` that a spec names, as `load_named` reads it; else BadInput at `key`."""
    try:
        found = load_named(spec)
    except NotLoaded as error:
        raise BadInput(where, key, str(error)) from error
    if not isinstance(found, type) or not issubclass(found, base) or not is_dataclass(found):
        got = f"{spec} is {cast('object', found)!r}"
        raise BadInput(where, key, f"expected a dataclass below {base.__name__}; {got}")
    missing: frozenset[str] = getattr(found, "__abstractmethods__", frozenset())
    if missing:
        raise BadInput(where, key, f"{found.__name__} has no {', '.join(sorted(missing))}")
    return found
