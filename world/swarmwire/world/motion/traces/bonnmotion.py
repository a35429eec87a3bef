"""BonnMotion's native format, `.movements` and `.movements.gz`: a line per node, `t x y` or `t x y z` repeated.

Nodes move in straight lines between way points. Positions are in m, from 0 to the scenario's extents x and y: the
origin is the lower left corner. A line that begins with # is a comment. Source: `Scenario.java`, `MobileNode.java` and
`printer/Printer.java` of github.com/sys-uos/BonnMotion. BonnMotion itself reads three dimensions if the file
`NAME.params` says `J=3D`, and then also writes a first line `#3D`; without either, the numbers decide.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np

from swarmwire.world.motion.traces.lines import Line, open_text, read_lines, refuse_empty
from swarmwire.world.motion.traces.trace import MotionTrace, trace_from

MARK_3D = "#3D"


def read(path: Path) -> MotionTrace:
    """Read a file; its nodes are named by their numbers from 0."""
    lines = list(read_lines(path))
    nodes = [line for line in lines if not line.text.startswith("#")]
    if not nodes:
        raise refuse_empty(path)
    numbers = [line.parse_numbers(line.text.split()) for line in nodes]
    width = _width(path, lines, numbers)
    for line, row in zip(nodes, numbers, strict=True):
        _check(line, row, width)
    samples = [np.pad(np.array(row).reshape(-1, width), ((0, 0), (0, 4 - width))) for row in numbers]
    return trace_from([str(node) for node in range(len(nodes))], samples)


def write(path: Path, trace: MotionTrace) -> None:
    """Write a file in two dimensions, or in three if any robot leaves the height 0."""
    width = 4 if trace.z_m.any() else 3
    with open_text(path, "w") as file:
        if width == 4:
            file.write(f"{MARK_3D}\n")
        for rows in trace.samples():
            file.write(" ".join(map(repr, rows[:, :width].reshape(-1).tolist())) + "\n")


def _width(path: Path, lines: list[Line], numbers: list[list[float]]) -> int:
    """Return the numbers of a way point: 3 in two dimensions, 4 in three."""
    stated = _stated_dimension(path)
    if lines[0].text == MARK_3D or stated == "3D":
        return 4
    return 4 if stated is None and not _fits(numbers, 3) and _fits(numbers, 4) else 3


def _stated_dimension(path: Path) -> str | None:
    """Return the value of J in the parameters beside the file; None without such a file or key."""
    parameters = path.with_name(f"{path.name.partition('.movements')[0]}.params")
    if not parameters.is_file():
        return None
    pairs = (line.text.partition("=") for line in read_lines(parameters))
    return next((value.strip().upper() for key, _, value in pairs if key.strip() == "J"), None)


def _fits(numbers: list[list[float]], width: int) -> bool:
    return all(len(row) % width == 0 and all(a <= b for a, b in pairwise(row[::width])) for row in numbers)


def _check(line: Line, row: list[float], width: int) -> None:
    way_point = "t x y z" if width == 4 else "t x y"
    if len(row) % width:
        raise line.refused(f"expected {way_point} repeated, got {len(row)} numbers")
    for before_s, t_s in pairwise(row[::width]):
        if t_s < before_s:
            raise line.refused(f"expected {way_point} with rising times, got {t_s:g} s after {before_s:g} s")
