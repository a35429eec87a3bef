"""Lines and branches that were run, part by part, in a report that `coverage json` wrote."""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PARTS = ("comms", "world", "agent")


@dataclass(frozen=True, slots=True)
class Counted:
    """Shares of what there is that were run."""

    lines: float
    branches: float


def counted(report: Path) -> dict[str, Counted]:
    """What was run of each part, and of all "together"."""
    files: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))["files"]
    sums: dict[str, Counter[str]] = {name: Counter() for name in (*PARTS, "together")}
    for path, told in files.items():
        part = Path(path).parts[Path(path).parts.index("swarmwire") + 1]
        for name in (part, "together"):
            sums[name].update({key: number for key, number in told["summary"].items() if key in _COUNTS})
    return {name: _shares(sum_) for name, sum_ in sums.items()}


_COUNTS = ("covered_lines", "num_statements", "covered_branches", "num_branches")


def _shares(of: Counter[str]) -> Counted:
    return Counted(of["covered_lines"] / of["num_statements"], of["covered_branches"] / of["num_branches"])
