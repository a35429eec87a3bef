"""Which code a run ran: a digest for each of swarmwire's parts and for each installed package that an agent is from."""

import hashlib
import importlib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

PARTS = ("swarmwire.comms", "swarmwire.agent", "swarmwire.world", "swarmwire.metrics", "swarmwire.deploy")
SOURCES = (".py", ".toml")  # code, and the data sheets of bodies


def module_digests(specs: Iterable[str]) -> dict[str, str]:
    """sha256 by module: of swarmwire's parts, and of the outermost package around each "package.module:Class".

    The digest is over the source files on the disk, sorted by name; a module that is no package is its one file. Agents
    may be edited and loaded anew while a process lives, so theirs are read each time; swarmwire's own, hundreds of
    files, once. What these packages import from others in turn is not followed.
    """
    places = [spec.rpartition(":")[0] for spec in specs]
    own = [_outermost(place) for place in places if not place.endswith(".py")]
    return {part: _digest_once(part) for part in PARTS} | {name: _digest(name) for name in sorted({*own} - {*PARTS})}


def changed_modules(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """The modules whose source differs, a line each."""
    return [f"module {name} has changed since" for name, digest in then.items() if now.get(name) != digest]


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
