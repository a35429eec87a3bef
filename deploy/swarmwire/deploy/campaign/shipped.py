"""A campaign's scenario with all its files as bytes, for workers that see another file system."""

import hashlib
import shutil
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path


def scenario_files(folder: Path) -> dict[str, bytes]:
    """By path within a campaign's scenario folder: the files' contents."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def unpacked(files: Mapping[str, bytes], within: Path | None = None) -> Path:
    """A folder with these files, made at the first call; `Task.scenario` is `scenario.toml` in it.

    It lies `within` a folder of the worker's own; by default in one that goes with this process.
    """
    whole = hashlib.sha256()
    for name, data in files.items():
        whole.update(f"{name}\0{len(data)}\0".encode() + data)
    above = within or Path(_own_folder().name)
    folder = above / whole.hexdigest()
    if not folder.exists():
        aside = Path(tempfile.mkdtemp(dir=above))
        for name, data in files.items():
            path = aside / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        _renamed(aside, folder)
    return folder


def _renamed(aside: Path, folder: Path) -> None:
    """Whole under its own name; another thread may have been quicker, with the same files."""
    try:
        aside.replace(folder)
    except OSError:
        shutil.rmtree(aside)
        if not folder.exists():
            raise


@cache
def _own_folder() -> "tempfile.TemporaryDirectory[str]":
    """Goes with the process."""
    return tempfile.TemporaryDirectory(prefix="swarmwire-campaign-")
