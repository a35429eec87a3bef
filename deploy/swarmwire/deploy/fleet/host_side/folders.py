"""Where things lie on a host."""

import os
from pathlib import Path

KEPT = 3  # releases of a robot that can be gone back to, the current one among them
TAKEN = ("env", "lock")  # in `root`, so that no robot can have such a name
PART = ".part"  # of what is not whole yet


def root() -> Path:
    """The folder of all that is deployed."""
    return Path.home() / "swarmwire"


def environment(name: str) -> Path:
    """The folder of some packages."""
    return root() / "env" / name


def releases(robot: str) -> Path:
    """The folder of a robot's releases."""
    return root() / robot / "releases"


def current(robot: str) -> str | None:
    """The release that starts next; None if there is none."""
    try:
        name = (root() / robot / "current").readlink().name
    except OSError:
        return None
    return name if (releases(robot) / name).is_dir() else None


def whole_in(folder: Path) -> list[str]:
    """The names of what is whole in a folder."""
    if not folder.is_dir():
        return []
    return sorted(path.name for path in folder.iterdir() if path.is_dir() and not path.name.endswith(PART))


def sync_files(folder: Path) -> None:
    """See to it that what a folder holds is on the disk, whatever happens to the robot from now on."""
    for path in folder.iterdir():
        if path.is_file() and not path.is_symlink():
            _sync(path)
    sync_folder(folder)


def sync_folder(folder: Path) -> None:
    """See to it that the names in a folder are on the disk."""
    _sync(folder)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_whole(path: Path, text: str) -> None:
    """A file that is there with all of this text, or as it was before."""
    part = path.with_name(path.name + PART)
    with part.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)
