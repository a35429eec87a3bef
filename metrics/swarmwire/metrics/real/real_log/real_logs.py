"""The logs of a swarm of real robots: a folder with one for each, or the folder of a single one; by one clock.

A clock that is ahead makes received packets late and sent ones early. A packet takes at least as long one way as the
other, so half the difference of the shortest latencies is that of the clocks (as in NTP, RFC 5905, section 8).
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
NAMED = 4  # robots that are named in a line, at most
APART_S = 0.005  # from which on it is worth a word, and is taken out
FEWEST = 20  # packets each way
SHORT = 0.05  # the quantile that stands for the shortest: a single one may be a clock that was set


@dataclass(frozen=True)
class RealLogs:
    """What was read, and what is amiss with it."""

    where: str
    robots: tuple[RealRobotLog, ...]  # in the order of their index
    notes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the robots of which there are logs."""
        return tuple(robot.name for robot in self.robots)

    @property
    def rate_hz(self) -> float:
        """Steps of each robot per second."""
        return self.robots[0].about.rate_hz


def read_real_logs(path: Path) -> RealLogs:
    """The logs in this folder, of each robot that of its newest start.

    BadInput for what is no log, and for robots of different swarms or rates.
    """
    if not path.is_dir():
        raise BadInput(str(path), "", "expected a folder of robots' logs: there is none")
    folders, older = newest_starts(log_folders(path))
    if not folders:
        raise BadInput(str(path), "", f"expected robots' logs: it holds no folder with a {ROBOT}")
    robots = [read_robot_log(folder) for folder in folders]
    _refuse_strangers(robots)
    place = {name: i for i, name in enumerate(robots[0].about.robots)}
    robots.sort(key=lambda robot: place[robot.name])
    return RealLogs(str(path), tuple(robots), (*_earlier(older, path), *_notes(robots)))


def in_step(logs: RealLogs) -> RealLogs:
    """The logs by one clock, with a note, if the clocks are apart so far that it matters; else as they are."""
    offsets_s = clock_offsets_s(logs.robots)
    apart = np.abs(offsets_s) > APART_S
    if not apart.any():
        return logs
    by_name = dict(zip(logs.names, offsets_s.tolist(), strict=True))
    told = [f"{name} {by_name[name]:+.3f} s" for name in sorted(by_name, key=lambda name: -abs(by_name[name]))]
    spread_s = float(np.ptp(offsets_s))
    note = (
        f"clocks up to {spread_s:.3g} s apart, by packets that went both ways "
        f"({named(told[: int(apart.sum())])} beside the median): taken out of times and latencies"
    )
    robots = tuple(_moved(robot, by_name) for robot in logs.robots)
    return replace(logs, robots=robots, notes=(*logs.notes, note))


def clock_offsets_s(robots: Sequence[RealRobotLog]) -> FloatArray:
    """How far each robot's clock is ahead of the swarm's median in s, (robots,); 0 where unknown."""
    place = {robot.name: i for i, robot in enumerate(robots)}
    short_s: dict[tuple[int, int], float] = {}
    for receiver, robot in enumerate(robots):
        for sender, received in robot.received.by_sender.items():
            known = received.latency_s[np.isfinite(received.latency_s)]
            if sender in place and len(known) >= FEWEST:
                short_s[place[sender], receiver] = float(np.quantile(known, SHORT))
    pairs = [(a, b) for a, b in short_s if a < b and (b, a) in short_s]
    if not pairs:
        return np.zeros(len(robots))
    ahead = np.zeros((len(pairs), len(robots)))
    half_s = np.array([0.5 * (short_s[a, b] - short_s[b, a]) for a, b in pairs])
    for row, (a, b) in enumerate(pairs):
        ahead[row, [a, b]] = -1.0, 1.0
    offsets_s: FloatArray = np.linalg.lstsq(ahead, half_s, rcond=None)[0].astype(np.float64)
    return offsets_s - np.median(offsets_s)


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


def named(names: Sequence[str]) -> str:
    """The first few of some names, and how many there are more.

    >>> named(["a", "b"]), named(["a", "b", "c", "d", "e"])
    ('a, b', 'a, b, c, d and 1 more')
    """
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def _folders(path: Path) -> list[Path]:
    return sorted(one for one in path.iterdir() if one.is_dir())


def _may_be_log(folder: Path) -> bool:
    """Whether it holds any file of a log: one without its robot.json is refused, not passed over."""
    return any((folder / name).exists() for name in FILES)


def _refuse_strangers(robots: Sequence[RealRobotLog]) -> None:
    """BadInput unless all are of one swarm and of one rate, each there once."""
    first, names = robots[0], dict[str, str]()
    for robot in robots:
        where = f"{robot.where}/{ROBOT}"
        for key in ("swarm", "robots", "rate_hz"):
            own, others = getattr(robot.about, key), getattr(first.about, key)
            if own != others:
                raise BadInput(where, key, f"expected that of {first.where}, {_text(others)}; got {_text(own)}")
        if robot.name in names:
            raise BadInput(where, "name", f"expected another robot than in {names[robot.name]}; got {robot.name!r}")
        names[robot.name] = robot.where


def _earlier(older: Sequence[Path], path: Path) -> list[str]:
    left_out = named([str(folder.relative_to(path)) for folder in older])
    return [f"earlier starts are left out, of each robot all but the newest: {left_out}"] if older else []


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, cast("tuple[object, ...]", value)))
    return str(value)


def _notes(robots: Sequence[RealRobotLog]) -> list[str]:
    there = {robot.name for robot in robots}
    missing = [name for name in robots[0].about.robots if name not in there]
    killed = [robot.name for robot in robots if robot.ended is None]
    notes: list[str] = []
    if missing:
        notes.append(f"no log of {named(missing)}: packets to and from there are left out")
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


def _moved(robot: RealRobotLog, offset_s: dict[str, float]) -> RealRobotLog:
    own_s = offset_s[robot.name]
    of_senders_s = np.array([offset_s.get(name, 0.0) for name in robot.received.sender.tolist()])
    received = replace(
        robot.received,
        time_s=robot.received.time_s - own_s,
        latency_s=robot.received.latency_s - (own_s - of_senders_s),
    )
    return replace(
        robot,
        steps=replace(robot.steps, time_s=robot.steps.time_s - own_s),
        sent=replace(robot.sent, time_s=robot.sent.time_s - own_s),
        received=received,
    )
