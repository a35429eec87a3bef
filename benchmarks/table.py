"""The lines that benchmarks printed as docs/dev/performance.csv: `python -m benchmarks.table < FILE`.

Lines of the engine pymunk, where there are any, stand beside those of the default one.
"""

import csv
import json
import sys
from collections.abc import Iterable
from typing import Any

from benchmarks.targets import TARGETS

HEAD = ("name", "target", "measured (lowest to highest of three)", "verdict", "pymunk", "what")
Line = dict[str, Any]
Row = tuple[str, ...]


def rows(lines: Iterable[Line]) -> list[Row]:
    """The heads, and a row for each benchmark, the last line of each counts."""
    default: dict[str, Line] = {}
    pymunk: dict[str, Line] = {}
    for line in lines:
        (pymunk if line.get("engine") == "pymunk" else default)[line["name"]] = line
    return [HEAD, *(_row(line, pymunk.get(name)) for name, line in default.items())]


def _row(line: Line, pymunk_line: Line | None) -> Row:
    name, target = line["name"], TARGETS.get(line["name"])
    target_text = f"{'≤' if target.at_most else '≥'} {_number(target.value)}" if target else ""
    met = "" if target is None else "met" if target.met_by(line["value"]) else "missed"
    between = f" ({_number(line['lowest'])} to {_number(line['highest'])})" if "lowest" in line else ""
    other = _number(pymunk_line["value"]) if pymunk_line else ""
    meaning = target.meaning if target else ""
    return name, target_text, f"{_number(line['value'])} {line['unit']}{between}", met, other, meaning


def _number(value: float) -> str:
    """Three digits that count, with commas."""
    return f"{float(f'{value:.3g}'):,.10g}"


if __name__ == "__main__":
    printed = (json.loads(line) for line in sys.stdin if line.startswith("{"))
    csv.writer(sys.stdout, lineterminator="\n").writerows(rows(printed))
