"""Where the logs of robots are in a folder: right there, one deeper or two, as each start leaves its own."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from swarmwire.metrics.real_log.about import ROBOT, read_about_robot
from swarmwire.metrics.real_log.robot_log import RECEIVED, SENT, TICKS

FILES = (ROBOT, TICKS, RECEIVED, SENT)


def log_folders(path: Path) -> list[Path]:
    """All folders of logs: this one, else those in it and, where these are none, those in them; by name."""
    if (path / ROBOT).exists():
        return [path]
    found: list[Path] = []
    for one in _folders(path):
        found += [one] if _may_be_log(one) else [start for start in _folders(one) if _may_be_log(start)]
    return found


def newest_starts(folders: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Of each robot the newest start, and those that are left out for it, both by name.

    Starts at the same time all stay, so that a copy of a log is found. BadInput for a folder that is no log.
    """
    starts: dict[str, list[tuple[int, Path]]] = defaultdict(list)
    for folder in folders:
        about = read_about_robot(folder / ROBOT)
        starts[about.name].append((about.started_utc_ns, folder))
    newest = {name: max(started for started, _ in of) for name, of in starts.items()}
    kept = [folder for name, of in starts.items() for started, folder in of if started == newest[name]]
    return sorted(kept), sorted(set(folders) - set(kept))


def _folders(path: Path) -> list[Path]:
    return sorted(one for one in path.iterdir() if one.is_dir())


def _may_be_log(folder: Path) -> bool:
    """Whether it holds any file of a log: one without its robot.json is refused, not passed over."""
    return any((folder / name).exists() for name in FILES)
