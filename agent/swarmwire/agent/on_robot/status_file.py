"""How a robot is, in a file that is always whole: for `swarmwire robots status`, and whoever looks on the robot."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

NAME = "status.json"  # in a folder of the robot's own


def status_path(log: str, robot: str) -> Path | None:
    """Where the status of a robot stands: in the folder of its logs, else in the user's folder for what runs."""
    if log:
        return Path(log) / f"{robot}-{NAME}"  # robots may share it
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    return Path(runtime) / "swarmwire" / robot / NAME if runtime else None


class StatusFile:
    """Written anew each time, and put in place of the last one; a disk that is full keeps the last one.

    Attributes:
        lost: how many could not be written so far.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self.lost = 0

    def write(self, status: Mapping[str, Any]) -> None:
        """Put a status, of plain values, in place of the last one."""
        if self._path is None:
            return
        written = self._path.with_name(f".{self._path.name}.{os.getpid()}")
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            written.write_text(json.dumps(status) + "\n", encoding="utf-8")
            written.replace(self._path)
        except OSError:
            self.lost += 1
