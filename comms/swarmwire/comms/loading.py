"""From the text that names a class of a user's to the class: an agent, a sensor, an actuator.

A file is loaded alone: its folder does not come onto `sys.path`, so it imports what is installed and nothing that
merely lies beside it. Its content is part of its module's name: an edited file is loaded anew, also in a notebook.
"""

import hashlib
import importlib
import importlib.util
import sys
from difflib import get_close_matches
from importlib.machinery import SourceFileLoader
from pathlib import Path
from traceback import extract_tb
from types import CodeType
from typing import Any


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
