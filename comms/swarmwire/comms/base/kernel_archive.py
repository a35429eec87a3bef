"""Kernel archives: compiled functions for the portable CPU in a zip file, which spare other machines to compile.

An archive holds numba's cache files below the paths of their sources, and `kernels.json` with what machine code depends
on. `read_archive` refuses an archive of another version, and adds to the cache beside what is there. Like any program,
an archive runs on the machine that takes it: take it only from where you would take code.
"""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportPrivateUsage=false

from __future__ import annotations

import hashlib
import platform
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile

import msgspec
from numba.core.caching import CompileResultCacheImpl, IndexDataCacheFile

import swarmwire
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.kernels import PORTABLE_CPU, PORTABLE_KEY, locked, missing_cpu_features

FORMAT = 1
MANIFEST = "kernels.json"
PARTS = ("comms", "world", "metrics")  # they have compiled functions, and the constants in these


class Manifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the machine code of an archive depends on."""

    format: int
    machine: str
    cpu: str
    python: str
    numba: str
    sources: dict[str, str]  # sha256 by path

    @classmethod
    def of_this_machine(cls) -> Self:
        """Return the manifest of archives that this machine writes."""
        python = f"{sys.version_info.major}.{sys.version_info.minor}"
        digests = {path: hashlib.sha256(source.read_bytes()).hexdigest() for path, source in sources().items()}
        return cls(FORMAT, platform.machine(), PORTABLE_CPU, python, version("numba"), digests)

    def check(self, archive: str) -> None:
        """Raise BadInput about the `archive`, with the key, unless this machine can use its machine code."""
        local = self.of_this_machine()
        for key in ("format", "machine", "cpu", "python", "numba"):
            if getattr(self, key) != getattr(local, key):
                raise BadInput(archive, key, f"expected {getattr(local, key)}, as here, got {getattr(self, key)}")
        if lacking := missing_cpu_features():
            raise BadInput(archive, "cpu", f"expected a processor that has {', '.join(lacking)}, as {self.cpu}")
        for path in sorted(self.sources.keys() | local.sources.keys()):
            if self.sources.get(path) != local.sources.get(path):
                raise BadInput(archive, "sources", f"expected the code installed here; {path} is another version")


def sources() -> dict[str, Path]:
    """Return the source files of the parts that have compiled functions, by path below the package."""
    roots = [root for base in swarmwire.__path__ for part in PARTS if (root := Path(base, part)).is_dir()]
    files = (file for root in roots for file in root.rglob("*.py"))
    return {
        file.relative_to(next(base for base in swarmwire.__path__ if file.is_relative_to(base))).as_posix(): file
        for file in sorted(files)
    }


def write_archive(archive: Path) -> int:
    """Write all machine code for the portable CPU that this machine has; return the number of compiled functions."""
    count = 0
    with TemporaryDirectory() as temporary, ZipFile(archive, "w", ZIP_DEFLATED) as packed:
        packed.writestr(MANIFEST, msgspec.json.encode(Manifest.of_this_machine()))
        for path, source in sources().items():
            folder = Path(temporary, path)
            for name in _names(_cache_folder(source), source):
                entries = _entries(_cache_file(source, name))
                if entries:
                    folder.mkdir(parents=True, exist_ok=True)
                    _add(_cache_file(source, name, folder), entries)
                    count += len(entries)
        for file in sorted(Path(temporary).rglob("*.nb[ic]")):
            packed.write(file, file.relative_to(temporary).as_posix())
    return count


def read_archive(archive: Path) -> int:
    """Add the machine code of an archive to this machine's cache; return the number of compiled functions.

    BadInput names the archive, and the key of `kernels.json` if it is of another version.
    """
    count = 0
    try:
        with TemporaryDirectory() as temporary, ZipFile(archive) as packed:
            manifest = msgspec.json.decode(packed.read(MANIFEST), type=Manifest)
            manifest.check(str(archive))
            packed.extractall(temporary)
            for path, source in sources().items():
                for name in _names(Path(temporary, path), source):
                    entries = _entries(_cache_file(source, name, Path(temporary, path)))
                    with locked(_cache_folder(source)):
                        _add(_cache_file(source, name), entries)
                    count += len(entries)
    except (BadZipFile, KeyError, msgspec.DecodeError) as error:
        raise BadInput(str(archive), "", f"expected a file of swarmwire kernels export: {error}") from None
    except OSError as error:
        expected = f"expected a file that can be read, and a cache that can be written: {error}"
        raise BadInput(str(archive), "", expected) from None
    return count


def _entries(file: Any) -> dict[Any, Any]:
    """Return machine code for the portable CPU by key; entries of sources that have changed since are left out."""
    try:
        names: dict[Any, str] = file._load_index()
        return {key: file._load_data(name) for key, name in names.items() if key[1][1:] == PORTABLE_KEY}
    except (AttributeError, ImportError, FileNotFoundError):  # an entry names a class that was renamed or moved
        return {}


def _add(file: Any, entries: dict[Any, Any]) -> None:
    for key, data in entries.items():
        file.save(key, data)


def _cache_file(source: Path, name: str, folder: Path | None = None) -> Any:
    """Return numba's index of a compiled function, in this machine's cache or in a folder."""
    return IndexDataCacheFile(str(folder or _cache_folder(source)), name, _impl(source).locator.get_source_stamp())


def _cache_folder(source: Path) -> Path:
    return Path(_impl(source).locator.get_cache_path())


def _names(folder: Path, source: Path) -> list[str]:
    """Return the names of the indices of a source file's compiled functions in a folder."""
    version = _impl(source).filename_base.rpartition(".")[2]  # of Python
    return sorted(path.stem for path in folder.glob(f"{source.stem}.*.{version}.nbi"))


@cache
def _impl(source: Path) -> Any:
    """Return numba's view of the cache of a source file, by a function that seems to be defined there."""
    names: dict[str, Any] = {}
    exec(compile("def function(): pass", str(source), "exec"), names)
    return CompileResultCacheImpl(names["function"])
