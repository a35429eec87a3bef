"""The packages of robots, made once for each platform and set of versions, and kept in the user's cache."""

import hashlib
import json
import os
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from swarmwire.deploy.fleet.archive import Archive, name_of, write_archive
from swarmwire.deploy.fleet.environment.own_packages import own_entries
from swarmwire.deploy.fleet.environment.pins import Pin, pins
from swarmwire.deploy.fleet.environment.target import Target
from swarmwire.deploy.fleet.environment.wheels import download, entries_of
from swarmwire.metrics.atomic import write_text

FORMAT = 1  # of what is made of wheels


class Environments(Protocol):
    """Where a robot's packages come from."""

    def archives(self, target: Target, drivers: Iterable[str], packages: Iterable[str]) -> list[Archive]:
        """The archives whose content a robot's Python has on its path, first before last; HostFailed without."""
        ...


class LockedEnvironments:
    """Packages at the versions that are installed here, as wheels from an index; swarmwire's own as they are here."""

    def __init__(self, cache: Path | None = None, index: Sequence[str] = ()) -> None:
        """`index` are options of pip's that say where wheels come from, such as --find-links FOLDER."""
        self._cache, self._index = cache or default_cache(), tuple(index)

    def archives(self, target: Target, drivers: Iterable[str], packages: Iterable[str]) -> list[Archive]:
        """Swarmwire's own packages, which change often and are small, and all others."""
        return [self._own(), self._of_wheels(target, pins(drivers, packages, target.python))]

    def _own(self) -> Archive:
        entries = own_entries()
        name = name_of(entries)
        return self._kept(name) or self._keep(write_archive(entries, self._path(name), name))

    def _of_wheels(self, target: Target, wanted: tuple[Pin, ...]) -> Archive:
        asked = self._cache / f"{target}-{_digest([*map(str, wanted), *self._index])}.txt"
        if asked.is_file():
            kept = self._kept(asked.read_text(encoding="utf-8").strip())
            if kept is not None:
                return kept
        with tempfile.TemporaryDirectory() as folder:
            wheels = download(wanted, target, Path(folder), self._index)
            sums = {wheel.name: hashlib.sha256(wheel.read_bytes()).hexdigest() for wheel in wheels}
            name = _digest([f"{name} {digest}" for name, digest in sums.items()])
            archive = self._kept(name) or self._keep(write_archive(entries_of(wheels), self._path(name), name))
        write_text(self._cache / f"{name}.wheels.json", json.dumps(sums, indent=2))
        write_text(asked, name)
        return archive

    def _path(self, name: str) -> Path:
        return self._cache / f"{name}.tar.gz"

    def _kept(self, name: str) -> Archive | None:
        """The archive of that name, if it has been made."""
        try:
            told: dict[str, Any] = json.loads((self._cache / f"{name}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        told["path"] = self._path(name)
        archive = Archive(**told)
        return archive if archive.path.is_file() and archive.path.stat().st_size == archive.size else None

    def _keep(self, archive: Archive) -> Archive:
        write_text(self._cache / f"{archive.name}.json", json.dumps({**asdict(archive), "path": ""}))
        return archive


def default_cache() -> Path:
    """Where the user's programs keep what they can make anew."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "swarmwire" / "robots"


def _digest(lines: Iterable[str]) -> str:
    return hashlib.sha256("\n".join([str(FORMAT), *sorted(lines)]).encode()).hexdigest()[:12]
