"""The logs of a swarm of real robots, a folder per robot, and their common clock.

A clock that is ahead increases the latencies of received packets and decreases those of sent packets. Shortest
latencies are equal in both directions, so half their difference is the offset of the clocks (as in NTP, RFC 5905,
section 8).
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.real.real_log.robot_log import (
    RECEIVED,
    ROBOT,
    SENT,
    TICKS,
    RealRobotLog,
    read_about_robot,
    read_robot_log,
)

FILES = (ROBOT, TICKS, RECEIVED, SENT)
MAX_NAMED = 4  # names in a line
MIN_OFFSET_S = 0.005  # offsets of clocks above this are noted and corrected
MIN_PACKETS = 20  # packets each way for an offset
SHORTEST = 0.05  # quantile of the shortest latency; the minimum may come from a change of the clock


@dataclass(frozen=True)
class RealLogs:
    """The logs of a swarm, with notes on problems."""

    where: str
    robots: tuple[RealRobotLog, ...]  # sorted by index in the swarm
    notes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the robots with logs."""
        return tuple(robot.name for robot in self.robots)

    @property
    def rate_hz(self) -> float:
        """Steps of each robot per second."""
        return self.robots[0].about.rate_hz


def read_real_logs(path: Path) -> RealLogs:
    """Read the logs in a folder, for each robot that of its newest start.

    BadInput for invalid logs, and for robots of different swarms or rates.
    """
    if not path.is_dir():
        raise BadInput(str(path), "", "expected a folder of robots' logs, which does not exist")
    folders, older = newest_starts(log_folders(path))
    if not folders:
        raise BadInput(str(path), "", f"expected robots' logs: it holds no folder with a {ROBOT}")
    robots = [read_robot_log(folder) for folder in folders]
    _refuse_strangers(robots)
    index = {name: i for i, name in enumerate(robots[0].about.robots)}
    robots.sort(key=lambda robot: index[robot.name])
    return RealLogs(str(path), tuple(robots), (*_earlier(older, path), *_notes(robots)))


def in_step(logs: RealLogs) -> RealLogs:
    """Return the logs by a common clock, with a note on offsets above MIN_OFFSET_S; without such offsets unchanged."""
    offsets_s = clock_offsets_s(logs.robots)
    large = np.abs(offsets_s) > MIN_OFFSET_S
    if not large.any():
        return logs
    by_name = dict(zip(logs.names, offsets_s.tolist(), strict=True))
    texts = [f"{name} {by_name[name]:+.3f} s" for name in sorted(by_name, key=lambda name: -abs(by_name[name]))]
    note = (
        f"clocks up to {float(np.ptp(offsets_s)):.3g} s apart, by packets that went both ways "
        f"({named(texts[: int(large.sum())])} from the median): taken out of times and latencies"
    )
    robots = tuple(_with_offset(robot, by_name) for robot in logs.robots)
    return replace(logs, robots=robots, notes=(*logs.notes, note))


def clock_offsets_s(robots: Sequence[RealRobotLog]) -> FloatArray:
    """Return the offset of each robot's clock from the swarm's median in s, (robots,); 0 if unknown."""
    index = {robot.name: i for i, robot in enumerate(robots)}
    shortest_s: dict[tuple[int, int], float] = {}
    for receiver, robot in enumerate(robots):
        for sender, received in robot.received.by_sender.items():
            finite_s = received.latency_s[np.isfinite(received.latency_s)]
            if sender in index and len(finite_s) >= MIN_PACKETS:
                shortest_s[index[sender], receiver] = float(np.quantile(finite_s, SHORTEST))
    pairs = [(a, b) for a, b in shortest_s if a < b and (b, a) in shortest_s]
    if not pairs:
        return np.zeros(len(robots))
    signs = np.zeros((len(pairs), len(robots)))
    differences_s = np.array([0.5 * (shortest_s[a, b] - shortest_s[b, a]) for a, b in pairs])
    for row, (a, b) in enumerate(pairs):
        signs[row, [a, b]] = -1.0, 1.0
    offsets_s: FloatArray = np.linalg.lstsq(signs, differences_s, rcond=None)[0].astype(np.float64)
    return offsets_s - np.median(offsets_s)


def log_folders(path: Path) -> list[Path]:
    """Return the folders of logs, sorted: this folder, else its sub-folders, or the sub-folders of these."""
    if (path / ROBOT).exists():
        return [path]
    logs: list[Path] = []
    for folder in _folders(path):
        logs += [folder] if _has_log_file(folder) else [start for start in _folders(folder) if _has_log_file(start)]
    return logs


def newest_starts(folders: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return the newest start of each robot, and the other folders, both sorted.

    Simultaneous starts are all kept, so that a copied log is refused later. BadInput for a folder without a log.
    """
    starts: dict[str, list[tuple[int, Path]]] = defaultdict(list)
    for folder in folders:
        about = read_about_robot(folder / ROBOT)
        starts[about.name].append((about.started_utc_ns, folder))
    newest: list[Path] = []
    for robot_starts in starts.values():
        newest_ns = max(started_ns for started_ns, _ in robot_starts)
        newest += [folder for started_ns, folder in robot_starts if started_ns == newest_ns]
    return sorted(newest), sorted(set(folders) - set(newest))


def named(names: Sequence[str]) -> str:
    """Return the first few names, and the number of others.

    >>> named(["a", "b"]), named(["a", "b", "c", "d", "e"])
    ('a, b', 'a, b, c, d and 1 more')
    """
    more = f" and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else ""
    return ", ".join(names[:MAX_NAMED]) + more


def _folders(path: Path) -> list[Path]:
    return sorted(entry for entry in path.iterdir() if entry.is_dir())


def _has_log_file(folder: Path) -> bool:
    """Return True if the folder has any file of a log; without robot.json it is refused later."""
    return any((folder / name).exists() for name in FILES)


def _refuse_strangers(robots: Sequence[RealRobotLog]) -> None:
    """Raise BadInput unless all robots are of the same swarm and rate, each once."""
    first, names = robots[0], dict[str, str]()
    for robot in robots:
        where = f"{robot.where}/{ROBOT}"
        for key in ("swarm", "robots", "rate_hz"):
            value, expected = getattr(robot.about, key), getattr(first.about, key)
            if value != expected:
                raise BadInput(where, key, f"expected that of {first.where}, {_text(expected)}; got {_text(value)}")
        if robot.name in names:
            raise BadInput(where, "name", f"expected another robot than in {names[robot.name]}; got {robot.name!r}")
        names[robot.name] = robot.where


def _earlier(older: Sequence[Path], path: Path) -> list[str]:
    names = named([str(folder.relative_to(path)) for folder in older])
    return [f"earlier starts are left out, for each robot all but the newest: {names}"] if older else []


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, cast("tuple[object, ...]", value)))
    return str(value)


def _notes(robots: Sequence[RealRobotLog]) -> list[str]:
    logged = {robot.name for robot in robots}
    missing = [name for name in robots[0].about.robots if name not in logged]
    killed = [robot.name for robot in robots if robot.ended is None]
    notes: list[str] = []
    if missing:
        notes.append(f"no log of {named(missing)}: packets from and to these robots are left out")
    if killed:
        notes.append(f"no summary of {named(killed)}: killed or still running")
    notes += [
        f"half a line at the end of {robot.name}'s {', '.join(robot.half_lines)} was dropped"
        for robot in robots
        if robot.half_lines
    ]
    agents = {(robot.about.agent, robot.about.agent_sha256) for robot in robots}
    if len(agents) > 1:
        notes.append(f"{len(agents)} different agents: {named(sorted(agent for agent, _ in agents))}")
    if len({str(robot.about.params) for robot in robots}) > 1:
        notes.append("the robots' params differ")
    return notes


def _with_offset(robot: RealRobotLog, offsets_s: dict[str, float]) -> RealRobotLog:
    """Return the log with its times corrected by the offsets of clocks."""
    offset_s = offsets_s[robot.name]
    sender_offsets_s = np.array([offsets_s.get(name, 0.0) for name in robot.received.sender.tolist()])
    received = replace(
        robot.received,
        time_s=robot.received.time_s - offset_s,
        latency_s=robot.received.latency_s - (offset_s - sender_offsets_s),
    )
    return replace(
        robot,
        steps=replace(robot.steps, time_s=robot.steps.time_s - offset_s),
        sent=replace(robot.sent, time_s=robot.sent.time_s - offset_s),
        received=received,
    )
