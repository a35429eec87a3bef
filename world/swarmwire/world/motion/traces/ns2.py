"""Movement files of ns-2 (`setdest`), `.tcl`, `.ns_movements` and `.setdest`, as ns-3's Ns2MobilityHelper reads them.

| statement | meaning |
| --- | --- |
| `$node_(3) set X_ 1.5` | position at the start, also for Y_ and Z_; without it 0 |
| `$ns_ at 2.0 "$node_(3) setdest 10 20 1.5"` | from 2 s on the node moves towards (10, 20) m at 1.5 m/s |
| `$ns_ at 2.0 "$node_(3) set X_ 1.5"` | at 2 s the node jumps there and stands; also Y_; Z_ changes the height alone |

A new `setdest` interrupts the one before it; a speed of 0 stops the node. BonnMotion's files in three dimensions have
`setdest x y z speed`. Positions are in m, by custom from the lower left corner. All other statements are ignored; nodes
without statements are absent. Source: `src/mobility/helper/ns2-mobility-helper.cc` and its tests, of ns-3. That helper
skips statements with faults; here they are refused. A height that changes is written in steps.
"""

import re
from collections import defaultdict
from itertools import pairwise
from math import inf, sqrt
from pathlib import Path
from typing import NamedTuple

from swarmwire.world.motion.traces.lines import Line, open_text, read_lines, refuse_empty
from swarmwire.world.motion.traces.trace import MotionTrace, trace_from

Sample = tuple[float, float, float, float]  # time in s, x, y and z in m
MOTION = re.compile(r"\bsetdest\b|\bset\s+[XYZ]_")
START = re.compile(r"\$node_\(([^)]*)\)\s+set\s+([XYZ])_\s+(\S+)")
EVENT = re.compile(r'\$ns_?\s+at\s+(\S+)\s+"\s*\$node_\(([^)]*)\)\s+(setdest|set\s+[XYZ]_)\s+([^"]*)"')
EXPECTED = 'expected $node_(I) set X_ V, or $ns_ at T "$node_(I) setdest X Y SPEED" or "$node_(I) set X_ V"'


class MotionEvent(NamedTuple):
    """A scheduled statement about a node."""

    line: Line
    t_s: float
    coordinate: int | None  # index of the coordinate that is set; None: a setdest
    values: list[float]  # the new value; or the destination in m and the speed in m/s


def read(path: Path) -> MotionTrace:
    """Read a file; the names of its nodes are their numbers."""
    starts, events = dict[int, list[float]](), defaultdict[int, list[MotionEvent]](list)
    for line in read_lines(path):
        content = line.content.rstrip("; \t")
        if not MOTION.search(content):
            continue
        if start := START.fullmatch(content):
            position = starts.setdefault(_parse_node(line, start[1]), [0.0, 0.0, 0.0])
            (position["XYZ".index(start[2])],) = line.parse_numbers([start[3]])
        elif match := EVENT.fullmatch(content):
            events[_parse_node(line, match[2])].append(_parse_event(line, match[1], match[3], match[4].split()))
        else:
            raise line.refused(EXPECTED)
    nodes = sorted({*starts, *events})
    if not nodes:
        raise refuse_empty(path)
    paths = [_path(starts.get(node, [0.0, 0.0, 0.0]), events[node]) for node in nodes]
    return trace_from([str(node) for node in nodes], paths)


def write(path: Path, trace: MotionTrace) -> None:
    """Write a file; the nodes are the robots' numbers, or 0, 1, … for named robots."""
    with open_text(path, "w") as file:
        for node, rows in zip(trace.numbers(0), trace.samples(), strict=True):
            samples = [tuple(row) for row in rows.tolist()]
            for axis, value in zip("XYZ", samples[0][1:], strict=True):
                file.write(f"$node_({node}) set {axis}_ {value!r}\n")
            for before, after in pairwise(samples):
                file.writelines(f"{statement}\n" for statement in _statements(node, before, after))


def _parse_node(line: Line, text: str) -> int:
    if not (text.isascii() and text.isdecimal()):
        raise line.refused(f"expected the number of a node, got {text!r}")
    return int(text)


def _parse_event(line: Line, time: str, statement: str, words: list[str]) -> MotionEvent:
    (t_s,), values = line.parse_numbers([time]), line.parse_numbers(words)
    if t_s < 0.0:
        raise line.refused(f"expected a time of at least 0 s, got {t_s:g}")
    if statement != "setdest":
        if len(values) != 1:
            raise line.refused(f"expected one number after {statement}, got {len(values)}")
        return MotionEvent(line, t_s, "XYZ".index(statement.split()[1][0]), values)
    if len(values) not in (3, 4) or values[-1] < 0.0:
        raise line.refused("expected setdest X Y SPEED with a speed of at least 0, or X Y Z SPEED")
    return MotionEvent(line, t_s, None, values)


def _path(start: list[float], events: list[MotionEvent]) -> list[Sample]:
    """Return the samples of a node: its start, and each begin and end of a motion."""
    samples = [(0.0, start[0], start[1], start[2])]
    for event in sorted(events, key=lambda event: event.t_s):  # ns-2 schedules them, in any order of the file
        position, destination = _position(samples, event.t_s), None
        if samples[-1][0] > event.t_s:
            destination = samples.pop()
        if samples[-1] != (event.t_s, *position):
            samples.append((event.t_s, *position))
        if event.coordinate is None:
            if (arrival := _arrival(event, position)) is not None:
                samples.append(arrival)
            continue
        moved = list(position)
        moved[event.coordinate] = event.values[0]
        samples.append((event.t_s, moved[0], moved[1], moved[2]))
        if event.coordinate == 2 and destination is not None:
            samples.append((*destination[:3], moved[2]))
    return samples


def _position(samples: list[Sample], t_s: float) -> tuple[float, float, float]:
    """Return the position at a time that is not before the last sample but one."""
    t1_s, *end = samples[-1]
    if t1_s <= t_s:
        return end[0], end[1], end[2]
    t0_s, *start = samples[-2]
    share = (t_s - t0_s) / (t1_s - t0_s)
    x_m, y_m, z_m = (a + share * (b - a) for a, b in zip(start, end, strict=True))
    return x_m, y_m, z_m


def _arrival(event: MotionEvent, position: tuple[float, float, float]) -> Sample | None:
    """Return the end of a motion that nothing interrupts; None if the node stands."""
    *destination, speed_mps = event.values
    x_m, y_m, z_m = (*destination, position[2])[:3]
    distance_m = _distance(position, (x_m, y_m, z_m))
    if distance_m == 0.0 or speed_mps == 0.0:
        return None
    t_s = event.t_s + distance_m / speed_mps
    if not t_s < inf:
        raise event.line.refused(f"expected a speed at which the node arrives, got {speed_mps:g}")
    return t_s, x_m, y_m, z_m


def _distance(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    return sqrt(dx * dx + dy * dy + dz * dz)


def _statements(node: int, before: Sample, after: Sample) -> list[str]:
    """Return the statements for the motion from a sample to the next."""
    (t0_s, x0_m, y0_m, z0_m), (t1_s, x_m, y_m, z_m) = before, after
    if t0_s == t1_s:  # a jump
        changed = [(axis, b) for axis, a, b in zip("XYZ", before[1:], after[1:], strict=True) if a != b]
        return [f'$ns_ at {t1_s!r} "$node_({node}) set {axis}_ {value!r}"' for axis, value in changed]
    statements: list[str] = []
    if (x0_m, y0_m) != (x_m, y_m):
        speed_mps = _distance((x0_m, y0_m, 0.0), (x_m, y_m, 0.0)) / (t1_s - t0_s)
        statements.append(f'$ns_ at {t0_s!r} "$node_({node}) setdest {x_m!r} {y_m!r} {speed_mps!r}"')
    if z0_m != z_m:
        statements.append(f'$ns_ at {t1_s!r} "$node_({node}) set Z_ {z_m!r}"')
    return statements
